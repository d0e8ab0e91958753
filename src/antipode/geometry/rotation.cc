#include "antipode/geometry/rotation.h"

#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "antipode/util/error.h"

namespace antipode {
namespace {

/// Twice the sine of the angle, times the axis.
Eigen::Vector3d AntisymmetricPart(const Eigen::Matrix3d& rotation) {
  return {rotation(2, 1) - rotation(1, 2), rotation(0, 2) - rotation(2, 0),
          rotation(1, 0) - rotation(0, 1)};
}

/// Unlike std::uniform_real_distribution, the same on every platform.
double UniformUnit(std::mt19937_64& generator) {
  return static_cast<double>(generator() >> 11) * 0x1.0p-53;
}

Eigen::Matrix3d RotationAbout(const Eigen::Vector3d& axis, double radians) {
  return Eigen::AngleAxisd(radians, axis).toRotationMatrix();
}

}  // namespace

double RotationAngleDeg(const Eigen::Matrix3d& rotation) {
  return DegreesFromRadians(std::atan2(AntisymmetricPart(rotation).norm(), rotation.trace() - 1.0));
}

double AngleBetweenDeg(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return RotationAngleDeg(a.transpose() * b);
}

Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return RotationAbout(rotation_vector / angle, angle);
}

Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& rotation) {
  const Eigen::Vector4d quaternion = QuaternionWxyz(rotation);
  const Eigen::Vector3d imaginary = quaternion.tail<3>();
  const double sine = imaginary.norm();
  if (sine == 0.0) return Eigen::Vector3d::Zero();
  return 2.0 * std::atan2(sine, quaternion[0]) / sine * imaginary;
}

Eigen::Matrix3d RotationAboutX(double radians) {
  return RotationAbout(Eigen::Vector3d::UnitX(), radians);
}

Eigen::Matrix3d RotationAboutY(double radians) {
  return RotationAbout(Eigen::Vector3d::UnitY(), radians);
}

Eigen::Matrix3d RotationAboutZ(double radians) {
  return RotationAbout(Eigen::Vector3d::UnitZ(), radians);
}

Eigen::Vector4d QuaternionWxyz(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond quaternion = Eigen::Quaterniond(rotation).normalized();
  const double sign = quaternion.w() < 0 ? -1.0 : 1.0;
  return sign * Eigen::Vector4d(quaternion.w(), quaternion.x(), quaternion.y(), quaternion.z());
}

Eigen::Matrix3d RotationFromQuaternionWxyz(const Eigen::Vector4d& quaternion) {
  const double length = quaternion.norm();
  if (!std::isfinite(length) || length == 0.0) {
    throw Error("quaternion", "is zero or not finite", "give four finite numbers w x y z");
  }
  const Eigen::Vector4d unit = quaternion / length;
  return Eigen::Quaterniond(unit[0], unit[1], unit[2], unit[3]).toRotationMatrix();
}

Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double handedness = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Eigen::Vector3d signs(1.0, 1.0, handedness < 0 ? -1.0 : 1.0);
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

Eigen::Matrix3d RandomRotation(std::mt19937_64& generator) {
  // Shoemake's method: two independent circles whose squared radii are u and 1 - u.
  const double u = UniformUnit(generator);
  const double first = 2.0 * std::numbers::pi * UniformUnit(generator);
  const double second = 2.0 * std::numbers::pi * UniformUnit(generator);
  const double inner = std::sqrt(u);
  const double outer = std::sqrt(1.0 - u);
  return RotationFromQuaternionWxyz({inner * std::cos(second), outer * std::sin(first),
                                     outer * std::cos(first), inner * std::sin(second)});
}

}  // namespace antipode
