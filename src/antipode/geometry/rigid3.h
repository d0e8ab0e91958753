#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace antipode {

/// A rigid motion of three-dimensional space: x_b = rotation * x_a + translation.
///
/// Values are named `b_from_a`, so that `c_from_b * b_from_a` is `c_from_a`.
struct Rigid3 {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  /// The motion a_from_b: (R, t) -> (R^T, -R^T t).
  Rigid3 Inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }

  /// Where the origin of frame b lies in frame a, e.g. the camera centre for camera_from_world: -R^T t.
  Eigen::Vector3d OriginInSource() const { return -(rotation.transpose() * translation); }

  /// The 3x4 matrix [R | t].
  Eigen::Matrix<double, 3, 4> Matrix() const {
    Eigen::Matrix<double, 3, 4> matrix;
    matrix << rotation, translation;
    return matrix;
  }
};

inline Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a) {
  return {c_from_b.rotation * b_from_a.rotation,
          c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

inline Eigen::Vector3d operator*(const Rigid3& b_from_a, const Eigen::Vector3d& point_in_a) {
  return b_from_a.rotation * point_in_a + b_from_a.translation;
}

}  // namespace antipode
