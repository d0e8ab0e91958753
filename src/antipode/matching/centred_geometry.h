#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "antipode/geometry/rigid3.h"
#include "antipode/matching/matcher.h"
#include "antipode/matching/sampson_refinement.h"
#include "antipode/matching/two_view_geometry.h"

namespace antipode {

/// Two cameras with one object's centre near their optical axes, as those of object-centric crops have it.
struct CentredCameras {
  CameraPair cameras;
  double reference_distance = 0, query_distance = 0;  ///< to the centre, in object radii
};

/// The deviations are those of the boxes' centres and sizes from the true ones, measured on rendered objects.
struct CentredGeometryOptions {
  double centre_deviation = 0.085;  ///< of the centre from the optical axis, in each direction, object radii
  double ratio_deviation = 0.18;    ///< of the logarithm of the ratio of both distances
  double search_scale_px = 16;      ///< sigma for rotations that are some degrees off
  double scale_px = 3;              ///< sigma for refined ones
  double half_depth = 1.4;          ///< matched points are at most so much nearer or farther than the centre, object radii
  double turn_deviation_deg = 2.5;  ///< of a refined rotation from its start
  int most_searched = 300;          ///< correspondences that the search looks at
  int most_refined = 250;           ///< those that refinement looks at; the support of its result counts all
  void Check() const;
};

/// How well correspondences agree with a rotation between two cameras that look at one object.
///
/// The centre is c_r = d_r exp(-g / 2) (a, b, 1) before the reference camera and c_q = d_q exp(g / 2) (c, d, 1) before
/// the query camera, with small a, b, c, d and g. So the rotation alone nearly fixes the pose,
///   t = c_q - R c_r,
/// and where few matches, a plane or a long lens leave the essential matrix undetermined, the object does not. The
/// support of a pose is a soft count of inliers (Geman and McClure's loss),
///   S(R, a, b, c, d, g) = sum_i 1 / (1 + (e_i^2 + h_i^2) / sigma^2) - (a^2 + .. + d^2) / (2 sigma_c^2) - g^2 / (2 sigma_g^2),
/// sigma_c = centre_deviation / distance, e_i the Sampson distance and h_i how far the query's point is beyond the part of
/// its epipolar line that shows the depths d_r - half_depth to d_r + half_depth: without it, a small turn explains what a
/// large one about the same axis does to a distant object.
class CentredGeometry {
 public:
  /// @throws InvalidOption; Error unless both distances are positive
  CentredGeometry(const Correspondences& correspondences, const CentredCameras& cameras,
                  const CentredGeometryOptions& options = {});

  std::size_t Matches() const { return rays_.size(); }

  /// With a = b = c = d = g = 0, sigma = search_scale_px and any depth, of every rotation.
  Eigen::VectorXf SearchSupport(std::span<const Eigen::Matrix3d> query_from_reference) const;

  struct SupportedPose {
    Rigid3 query_from_reference;  ///< in object radii
    double support = 0;           ///< with sigma = scale_px
  };

  /// With the centre on both axes.
  SupportedPose Centred(const Eigen::Matrix3d& query_from_reference) const;

  /// The maximum of S - angle(R, start)^2 / (2 turn_deviation^2), sigma shrinking from search_scale_px to scale_px (Ceres).
  /// Along some directions S is nearly flat; there the start knows better.
  SupportedPose Refine(const Eigen::Matrix3d& start) const;

 private:
  SupportedPose WithSupport(const Eigen::Matrix3d& query_from_reference, const double* offsets) const;

  std::vector<RayPair> rays_;
  CentredCameras cameras_;
  CentredGeometryOptions options_;
};

}  // namespace antipode
