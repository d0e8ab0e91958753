#pragma once

#include <filesystem>
#include <optional>

#include <opencv2/core.hpp>

#include "antipode/geometry/rigid3.h"
#include "antipode/matching/two_view_geometry.h"

namespace antipode {

/// Depths along the optical axis, 32FC1 of the image's size; 0 or not finite where unknown.
/// @param unit what the file's numbers are multiplied by; without, 0.001 for a 16-bit file (millimetres become
///   metres) and 1 for a float32 TIFF
/// @throws BadFile if it is missing, no single-channel 16-bit or float image, or of another size than `expected`
cv::Mat LoadDepth(const std::filesystem::path& path, cv::Size expected, std::optional<double> unit = {});

struct DepthPoseOptions {
  double reprojection_px = 3;   ///< PnP: greatest distance of an inlier
  double distance = 0.05;       ///< Procrustes: greatest distance of an inlier, in units of the depth
  int iterations = 1000;
  double confidence = 0.9999;
  std::uint64_t seed = 1;       ///< of the drawn samples of Procrustes
};

/// Pose and translation in the depth's unit by perspective-n-point: reference points lifted by the depth of the
/// pixel they fall into, P3P in RANSAC, refined on the inliers. Baseline "SIFT + depth + PnP" of the paper.
/// @return nothing with fewer than four usable points or without a consistent sample
std::optional<Rigid3> PoseFromPnp(const Correspondences& correspondences, const CameraPair& cameras,
                                  const cv::Mat& reference_depth, const DepthPoseOptions& options = {});

/// The same by aligning the points lifted in both images (orthogonal Procrustes in RANSAC over three points).
/// @return nothing with fewer than three usable points or without a consistent sample
std::optional<Rigid3> PoseFromProcrustes(const Correspondences& correspondences, const CameraPair& cameras,
                                         const cv::Mat& reference_depth, const cv::Mat& query_depth,
                                         const DepthPoseOptions& options = {});

}  // namespace antipode
