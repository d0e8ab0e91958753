#include "antipode/geometry/wigner.h"

#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/spherical_harmonics.h"

namespace antipode {
namespace {

constexpr int kMaxDegree = 10;

Eigen::Vector3d RandomDirection(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
}

TEST(SphericalHarmonics, AreOrthonormal) {
  // Quadrature exact for the products: Gauss-Legendre in z would be shorter, a dense grid is simpler.
  const int rings = 400, sectors = 64;
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(49, 49);
  for (int i = 0; i < rings; ++i) {
    const double z = -1 + (2 * i + 1.0) / rings, r = std::sqrt(1 - z * z);
    for (int j = 0; j < sectors; ++j) {
      const double angle = 2 * M_PI * j / sectors;
      const auto y = SphericalHarmonics({r * std::cos(angle), r * std::sin(angle), z}, 6);
      gram += y * y.transpose() * (4 * M_PI / (rings * sectors));
    }
  }
  EXPECT_LT((gram - Eigen::MatrixXd::Identity(49, 49)).cwiseAbs().maxCoeff(), 1e-3);
}

TEST(SphericalHarmonics, DegreeOneIsYZX) {
  std::mt19937_64 random(1);
  const Eigen::Vector3d d = RandomDirection(random);
  const auto y = SphericalHarmonics(d, 1);
  const double scale = std::sqrt(3 / (4 * M_PI));
  EXPECT_NEAR(y[1], scale * d.y(), 1e-14);
  EXPECT_NEAR(y[2], scale * d.z(), 1e-14);
  EXPECT_NEAR(y[3], scale * d.x(), 1e-14);
}

TEST(Wigner, RotatesTheHarmonics) {
  std::mt19937_64 random(2);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Matrix3d rotation = RandomRotation(random);
    const Eigen::Vector3d x = RandomDirection(random);
    const auto before = SphericalHarmonics(x, kMaxDegree);
    const auto after = SphericalHarmonics(rotation * x, kMaxDegree);
    const auto stacked = WignerMatrices(rotation, kMaxDegree);
    for (int l = 0; l <= kMaxDegree; ++l) {
      const Eigen::VectorXd turned = WignerBlock(stacked, l) * before.segment(l * l, 2 * l + 1);
      EXPECT_LT((turned - after.segment(l * l, 2 * l + 1)).norm(), 1e-12) << "degree " << l;
    }
  }
}

TEST(Wigner, IsAnOrthogonalRepresentation) {
  std::mt19937_64 random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Matrix3d a = RandomRotation(random), b = RandomRotation(random);
    const auto of_a = WignerMatrices(a, kMaxDegree), of_b = WignerMatrices(b, kMaxDegree);
    const auto of_product = WignerMatrices(Eigen::Matrix3d(a * b), kMaxDegree);
    for (int l = 0; l <= kMaxDegree; ++l) {
      const Eigen::MatrixXd block = WignerBlock(of_a, l);
      EXPECT_LT((block * WignerBlock(of_b, l) - WignerBlock(of_product, l)).norm(), 1e-11);
      EXPECT_LT((block.transpose() * block - Eigen::MatrixXd::Identity(2 * l + 1, 2 * l + 1)).norm(), 1e-11);
    }
  }
}

TEST(Wigner, BatchAgreesWithSingle) {
  std::mt19937_64 random(4);
  std::vector<Eigen::Matrix3d> rotations;
  for (int i = 0; i < 77; ++i) rotations.push_back(RandomRotation(random));
  const auto rows = WignerMatrices(rotations, kMaxDegree);
  for (int i = 0; i < 77; ++i) {
    const auto expected = WignerMatrices(rotations[i], kMaxDegree);
    EXPECT_LT((rows.row(i).transpose().cast<double>() - expected).cwiseAbs().maxCoeff(), 2e-5);
  }
}

TEST(Wigner, GeneratorsAreTheDerivative) {
  const double step = 1e-5;
  for (int l = 0; l <= kMaxDegree; ++l) {
    const auto generators = WignerGenerators(l);
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Matrix3d forward =
          Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(axis)).toRotationMatrix();
      const Eigen::Matrix3d backward = forward.transpose();
      const auto plus = WignerMatrices(forward, l), minus = WignerMatrices(backward, l);
      const Eigen::MatrixXd slope = (WignerBlock(plus, l) - WignerBlock(minus, l)) / (2 * step);
      EXPECT_LT((slope - generators[axis]).cwiseAbs().maxCoeff(), 1e-6) << l << " " << axis;
    }
  }
}

}  // namespace
}  // namespace antipode
