#pragma once

#include <numbers>
#include <random>

#include <Eigen/Core>

namespace antipode {

constexpr double RadiansFromDegrees(double degrees) { return degrees * (std::numbers::pi / 180.0); }
constexpr double DegreesFromRadians(double radians) { return radians * (180.0 / std::numbers::pi); }

/// Angle of a rotation in degrees, 0..180: atan2(|a|, trace - 1) with a the vector of the
/// antisymmetric part R - R^T. Keeps full precision near 0 and near 180, where arccos loses half of
/// it.
double RotationAngleDeg(const Eigen::Matrix3d& rotation);

/// Angle in degrees between two rotations, 0..180: the angle of a^T b.
double AngleBetweenDeg(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b);

/// Exponential map: the rotation by |v| radians about v (right-handed). Zero gives the identity.
Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& rotation_vector);

/// Logarithm: the rotation vector (axis times angle in radians) with angle in 0..pi. At exactly pi
/// the sign of the axis is arbitrary.
Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& rotation);

/// Right-handed rotation about one axis. With y down, a positive turn about z turns a picture
/// clockwise as seen on screen.
Eigen::Matrix3d RotationAboutX(double radians);
Eigen::Matrix3d RotationAboutY(double radians);
Eigen::Matrix3d RotationAboutZ(double radians);

/// Unit quaternion (w, x, y, z) with w >= 0.
Eigen::Vector4d QuaternionWxyz(const Eigen::Matrix3d& rotation);

/// Rotation of a quaternion (w, x, y, z) of any length but zero.
/// @throws Error if the quaternion is zero or not finite
Eigen::Matrix3d RotationFromQuaternionWxyz(const Eigen::Vector4d& quaternion);

/// The rotation closest to `matrix` in the Frobenius norm: U diag(1, 1, det(U V^T)) V^T.
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix);

/// Uniform over SO(3). The same generator state gives the same rotation on every platform.
Eigen::Matrix3d RandomRotation(std::mt19937_64& generator);

}  // namespace antipode
