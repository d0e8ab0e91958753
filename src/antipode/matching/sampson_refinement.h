#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "antipode/geometry/camera.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/matching/matcher.h"

namespace antipode {

/// Rays (x, y, 1) of one point in both cameras.
struct RayPair {
  Eigen::Vector3d reference, query;
};

std::vector<RayPair> RaysOf(const Correspondences& correspondences, const PinholeCamera& reference, const PinholeCamera& query);

/// (y^T E x) / sqrt((E x)_1^2 + (E x)_2^2 + (E^T y)_1^2 + (E^T y)_2^2),  E = [t]_x R: the signed Sampson distance on
/// the plane at depth 1, of any scalar type that Ceres differentiates.
template <typename T>
T SignedSampsonDistance(const RayPair& rays, const Eigen::Matrix<T, 3, 3>& rotation,
                        const Eigen::Matrix<T, 3, 1>& translation) {
  using Vector = Eigen::Matrix<T, 3, 1>;
  const Vector reference = rays.reference.cast<T>(), query = rays.query.cast<T>();
  const Vector line_in_query = translation.cross(rotation * reference);
  const Vector line_in_reference = rotation.transpose() * query.cross(translation);
  const T squared = line_in_query.template head<2>().squaredNorm() + line_in_reference.template head<2>().squaredNorm();
  using std::sqrt;
  return query.dot(line_in_query) / sqrt(squared + T(1e-20));
}

/// The scale of one of several steps from `first` to `last` in equal factors.
inline double ScaleOfStep(double first, double last, int step, int steps) {
  return first * std::pow(last / first, static_cast<double>(step) / (steps - 1));
}

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
