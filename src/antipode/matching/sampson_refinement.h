#pragma once

#include <vector>

#include <Eigen/Core>

#include "antipode/geometry/rigid3.h"

namespace antipode {

/// Rays (x, y, 1) of one point in both cameras.
struct RayPair {
  Eigen::Vector3d reference, query;
};

struct RefinedPose {
  Rigid3 query_from_reference;                ///< |translation| = 1
  Eigen::Matrix<double, 5, 5> covariance;     ///< see TwoViewGeometry
};

/// Minimises the sum of Cauchy losses of the Sampson distances over SO(3) x S^2.
/// @param focal_length turns distances on the image plane into pixels
/// @param scale_px where the loss starts to flatten
RefinedPose RefineBySampsonError(const std::vector<RayPair>& rays, const Rigid3& initial, double focal_length,
                                 double scale_px);

}  // namespace antipode
