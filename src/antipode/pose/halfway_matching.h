#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "antipode/matching/matcher.h"
#include "antipode/object/object_view.h"

namespace antipode {

/// Between the optical axes of two cameras, degrees.
double AngleBetweenAxesDeg(const Eigen::Matrix3d& b_from_a);

/// A smooth stand-in for a shape that is not known; lengths in object radii.
struct HalfwayOptions {
  double dome_height = 0.6;         ///< h
  double dome_radius = 1.2;         ///< rho
  double half_width = 1.15;         ///< of the surface that the pictures show
  double least_facing = 0.15;       ///< cosine between the dome's normal and the direction to the crop's camera; below it is hidden
  double greatest_angle_deg = 120;  ///< between the optical axes; beyond it the crops have no surface in common
  void Check() const;
};

/// Axes of a parallel projection whose direction is halfway between those of two cameras.
struct HalfwayAxes {
  Eigen::Matrix3d halfway_from_reference = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d halfway_from_query = Eigen::Matrix3d::Identity();
};

/// With R = query_crop_from_reference_crop and m = (e_z + R^T e_z) / |e_z + R^T e_z|, the optical axes' mean in the axes of the
/// reference: halfway_from_reference = A, the smallest rotation with A m = e_z, and halfway_from_query = A R^T. So the
/// in-plane rotation between the crops is undone, too. The axes must not be opposite.
HalfwayAxes TurnHalfway(const Eigen::Matrix3d& query_crop_from_reference_crop);

/// A crop resampled on a dome that stands in for the object, seen from halfway. The pixel (u, v) shows the point
///   x = s (u - n / 2),  y = s (v - n / 2),  z = -h max(0, 1 - (x^2 + y^2) / rho^2),  s = 2 half_width / n
/// in halfway axes, relative to the object's centre; n is the crop's size.
class HalfwayView {
 public:
  HalfwayView(const ObjectView& crop, const Eigen::Matrix3d& halfway_from_crop, const HalfwayOptions& options = {});

  /// 8UC3, RGB; white where the crop is, where the dome faces away from its camera and outside the crop.
  cv::Mat Image() const;

  /// Pixel of the crop that shows what `pixel` shows.
  Eigen::Vector2d InCrop(const Eigen::Vector2d& pixel) const;

 private:
  Eigen::Vector3d OnDome(const Eigen::Vector2d& pixel) const;
  Eigen::Vector2d Project(const Eigen::Vector3d& on_dome) const;
  bool IsSeen(const Eigen::Vector3d& on_dome) const;

  const ObjectView& crop_;
  Eigen::Matrix3d crop_from_halfway_;
  Eigen::Vector3d camera_;  ///< the crop's, in halfway axes
  HalfwayOptions options_;
};

/// Matches two crops after both were turned to where a camera halfway would stand, given how they are turned to each other.
///
/// Seen from far apart, the same surface is foreshortened differently and local features no longer agree; on the dome they
/// nearly do. Matches are carried back to the crops, so that the dome decides which are found, not where they are: they are as
/// good a witness against the rotation as for it.
/// @return pixels of the crops, on the object in both; empty where the optical axes are too far apart
Correspondences MatchHalfway(const Matcher& matcher, const ObjectView& reference, const ObjectView& query,
                             const Eigen::Matrix3d& query_crop_from_reference_crop, const HalfwayOptions& options = {});

}  // namespace antipode
