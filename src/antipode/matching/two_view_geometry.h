#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "antipode/geometry/camera.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/matching/matcher.h"

namespace antipode {

/// Two calibrated cameras that see the same points.
struct CameraPair {
  PinholeCamera reference, query;

  double MeanFocalLength() const { return (reference.fx + reference.fy + query.fx + query.fy) / 4; }
};

enum class TwoViewStatus {
  kFound,           ///< rotation and translation direction are determined
  kPlanar,          ///< one homography explains the inliers: the pose may be the other of two solutions
  kPureRotation,    ///< turning the camera explains the inliers: the translation means nothing
  kTooFewMatches,   ///< no pose
};

/// "found", "planar", "pure rotation", "too few matches".
std::string NameOf(TwoViewStatus status);

struct TwoViewGeometryOptions {
  double threshold_px = 1.5;  ///< greatest Sampson distance of an inlier, at the mean focal length
  double confidence = 0.9999; ///< probability of having drawn one sample without outliers
  int iterations = 10000;     ///< samples at most
  int least_inliers = 8;      ///< fewer are chance: five points always fit
  void Check() const;
};

struct TwoViewGeometry {
  TwoViewStatus status = TwoViewStatus::kTooFewMatches;
  Rigid3 query_from_reference;          ///< |translation| = 1
  std::vector<std::uint8_t> is_inlier;  ///< one a correspondence
  int inliers = 0;
  /// Of the rotation vector that turns the estimate into the truth (query axes, radians, first three) and of
  /// the translation direction in two directions orthogonal to it (radians). Infinite where undetermined.
  Eigen::Matrix<double, 5, 5> covariance = Eigen::Matrix<double, 5, 5>::Constant(1e300);

  /// Root of the mean variance of the rotation's three angles, degrees.
  double RotationDeviationDeg() const;
};

/// Sampson distances in pixels at the mean focal length f of both cameras, one a correspondence:
///   f |y^T E x| / sqrt((E x)_1^2 + (E x)_2^2 + (E^T y)_1^2 + (E^T y)_2^2),  E = [t]_x R,
/// x and y the rays (., ., 1) of both points. (Hartley and Zisserman, 2nd edition, section 11.4.3.)
std::vector<double> SampsonDistances(const Correspondences& correspondences, const CameraPair& cameras,
                                     const Rigid3& query_from_reference);

/// Relative pose from correspondences: essential matrix by the five-point algorithm and MAGSAC (OpenCV),
/// decomposed so that most points lie in front of both cameras, then the robust Sampson error (Cauchy) of the
/// inliers minimised over SO(3) x S^2 (Ceres), and the inliers counted again.
TwoViewGeometry EstimateTwoViewGeometry(const Correspondences& correspondences, const CameraPair& cameras,
                                        const TwoViewGeometryOptions& options = {});

/// The last step alone, from a pose close by: minimises the robust Sampson error of the correspondences within
/// `capture_px` of it, with the threshold shrinking to `options.threshold_px`.
TwoViewGeometry RefineTwoViewGeometry(const Correspondences& correspondences, const CameraPair& cameras,
                                      const Rigid3& initial_query_from_reference, double capture_px,
                                      const TwoViewGeometryOptions& options = {});

}  // namespace antipode
