#include "antipode/geometry/rotation.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kSeeds = 200;

Eigen::Vector3d RandomAxis(std::mt19937_64& generator) {
  std::normal_distribution<double> normal;
  return Eigen::Vector3d(normal(generator), normal(generator), normal(generator)).normalized();
}

TEST(Rotation, RandomRotationsAreRotations) {
  std::mt19937_64 generator(7);
  for (int i = 0; i < kSeeds; ++i) {
    const Eigen::Matrix3d rotation = RandomRotation(generator);
    EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
    EXPECT_NEAR(rotation.determinant(), 1, 1e-14);
  }
}

TEST(Rotation, RandomRotationsAreUniform) {
  // Over SO(3) the mean of R is zero, and the angle has the mean pi / 2 + 2 / pi.
  std::mt19937_64 generator(8);
  constexpr int kCount = 20000;
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  double mean_angle = 0;
  for (int i = 0; i < kCount; ++i) {
    const Eigen::Matrix3d rotation = RandomRotation(generator);
    mean += rotation / kCount;
    mean_angle += RotationAngleDeg(rotation) / kCount;
  }
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), 0.02);
  EXPECT_NEAR(mean_angle, DegreesFromRadians(std::numbers::pi / 2 + 2 / std::numbers::pi), 1.0);
}

TEST(Rotation, AngleIsAccurateEverywhere) {
  std::mt19937_64 generator(1);
  for (const double degrees :
       {0.0, 1e-9, 1e-5, 0.1, 45.0, 90.0, 179.9, 180 - 1e-5, 180 - 1e-9, 180.0}) {
    for (int i = 0; i < 20; ++i) {
      const Eigen::Matrix3d rotation =
          Eigen::AngleAxisd(RadiansFromDegrees(degrees), RandomAxis(generator)).toRotationMatrix();
      EXPECT_NEAR(RotationAngleDeg(rotation), degrees, 1e-12) << degrees;
    }
  }
}

TEST(Rotation, AngleBetweenIsSymmetricAndUnchangedByCommonRotations) {
  std::mt19937_64 generator(2);
  for (int i = 0; i < kSeeds; ++i) {
    const Eigen::Matrix3d a = RandomRotation(generator), b = RandomRotation(generator);
    const Eigen::Matrix3d common = RandomRotation(generator);
    const double angle = AngleBetweenDeg(a, b);
    EXPECT_NEAR(AngleBetweenDeg(b, a), angle, 1e-11);
    EXPECT_NEAR(AngleBetweenDeg(common * a, common * b), angle, 1e-11);
    EXPECT_NEAR(AngleBetweenDeg(a * common, b * common), angle, 1e-11);
    EXPECT_NEAR(angle, DegreesFromRadians(Eigen::AngleAxisd(a.transpose() * b).angle()), 1e-6);
  }
}

TEST(Rotation, LogarithmUndoesExponential) {
  std::mt19937_64 generator(3);
  for (const double angle : {0.0, 1e-12, 1e-6, 0.3, 1.0, 2.0, 3.0, 3.1415926}) {
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d vector = angle * RandomAxis(generator);
      EXPECT_LT((VectorFromRotation(RotationFromVector(vector)) - vector).norm(), 1e-13) << angle;
    }
  }
}

TEST(Rotation, ExponentialUndoesLogarithm) {
  std::mt19937_64 generator(4);
  for (int i = 0; i < kSeeds; ++i) {
    const Eigen::Matrix3d rotation = RandomRotation(generator);
    const Eigen::Vector3d vector = VectorFromRotation(rotation);
    EXPECT_LE(vector.norm(), std::numbers::pi + 1e-12);
    EXPECT_LT((RotationFromVector(vector) - rotation).norm(), 1e-13);
  }
  const Eigen::Matrix3d half_turn = Eigen::Vector3d(-1, 1, -1).asDiagonal();
  EXPECT_LT((RotationFromVector(VectorFromRotation(half_turn)) - half_turn).norm(), 1e-13);
}

TEST(Rotation, AboutAnAxisIsRightHanded) {
  const double quarter = std::numbers::pi / 2;
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(),
                        z = Eigen::Vector3d::UnitZ();
  EXPECT_LT((RotationAboutX(quarter) * y - z).norm(), 1e-15);
  EXPECT_LT((RotationAboutY(quarter) * z - x).norm(), 1e-15);
  EXPECT_LT((RotationAboutZ(quarter) * x - y).norm(), 1e-15);
}

TEST(Rotation, QuaternionRoundTrip) {
  std::mt19937_64 generator(5);
  for (int i = 0; i < kSeeds; ++i) {
    const Eigen::Matrix3d rotation = RandomRotation(generator);
    const Eigen::Vector4d quaternion = QuaternionWxyz(rotation);
    EXPECT_NEAR(quaternion.norm(), 1, 1e-15);
    EXPECT_GE(quaternion[0], 0);
    EXPECT_LT((RotationFromQuaternionWxyz(quaternion) - rotation).norm(), 1e-14);
    EXPECT_LT((RotationFromQuaternionWxyz(-3.0 * quaternion) - rotation).norm(), 1e-14);
  }
  const double half = std::sqrt(0.5);
  EXPECT_LT(
      (QuaternionWxyz(RotationAboutZ(std::numbers::pi / 2)) - Eigen::Vector4d(half, 0, 0, half))
          .norm(),
      1e-15);
}

TEST(Rotation, QuaternionMustHaveADirection) {
  EXPECT_THROW(RotationFromQuaternionWxyz(Eigen::Vector4d::Zero()), Error);
  EXPECT_THROW(RotationFromQuaternionWxyz({1, std::nan(""), 0, 0}), Error);
}

TEST(Rotation, NearestRotationRemovesSmallDistortions) {
  std::mt19937_64 generator(6);
  std::normal_distribution<double> normal;
  for (int i = 0; i < kSeeds; ++i) {
    const Eigen::Matrix3d rotation = RandomRotation(generator);
    // A symmetric positive factor changes nothing: that is the polar decomposition.
    Eigen::Matrix3d factor = Eigen::Matrix3d::NullaryExpr([&] { return normal(generator); });
    factor = factor * factor.transpose() + 0.1 * Eigen::Matrix3d::Identity();
    EXPECT_LT((NearestRotation(rotation * factor) - rotation).norm(), 1e-9);
  }
}

TEST(Rotation, NearestRotationIsNoWorseThanItsNeighbours) {
  std::mt19937_64 generator(9);
  std::normal_distribution<double> normal;
  for (int i = 0; i < kSeeds; ++i) {
    const Eigen::Matrix3d matrix = Eigen::Matrix3d::NullaryExpr([&] { return normal(generator); });
    const Eigen::Matrix3d nearest = NearestRotation(matrix);
    EXPECT_NEAR(nearest.determinant(), 1, 1e-12);
    const Eigen::Matrix3d neighbour = nearest * RotationFromVector(0.01 * RandomAxis(generator));
    EXPECT_LE((nearest - matrix).norm(), (neighbour - matrix).norm() + 1e-12);
  }
}

}  // namespace
}  // namespace antipode
