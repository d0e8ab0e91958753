#include "antipode/geometry/rigid3.h"

#include <cstdint>
#include <random>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

Rigid3 RandomRigid3(std::mt19937_64& generator) {
  std::normal_distribution<double> normal;
  return {RandomRotation(generator),
          {3 * normal(generator), 3 * normal(generator), 3 * normal(generator)}};
}

Eigen::Vector3d RandomPoint(std::mt19937_64& generator) {
  std::normal_distribution<double> normal;
  return {normal(generator), normal(generator), normal(generator)};
}

template <typename Law>
void HoldsForManySeeds(Law law) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937_64 generator(seed);
    law(generator);
  }
}

TEST(Rigid3, InverseUndoesTheMotion) {
  HoldsForManySeeds([](std::mt19937_64& generator) {
    const Rigid3 b_from_a = RandomRigid3(generator);
    const Eigen::Vector3d point = RandomPoint(generator);
    EXPECT_LT((b_from_a.Inverse() * (b_from_a * point) - point).norm(), 1e-13);
    const Rigid3 identity = b_from_a * b_from_a.Inverse();
    EXPECT_LT((identity.rotation - Eigen::Matrix3d::Identity()).norm(), 1e-13);
    EXPECT_LT(identity.translation.norm(), 1e-13);
  });
}

TEST(Rigid3, ProductIsFirstTheRightThenTheLeft) {
  HoldsForManySeeds([](std::mt19937_64& generator) {
    const Rigid3 b_from_a = RandomRigid3(generator);
    const Rigid3 c_from_b = RandomRigid3(generator);
    const Eigen::Vector3d point = RandomPoint(generator);
    EXPECT_LT(((c_from_b * b_from_a) * point - c_from_b * (b_from_a * point)).norm(), 1e-13);
  });
}

TEST(Rigid3, OriginInSourceIsTheCameraCentre) {
  HoldsForManySeeds([](std::mt19937_64& generator) {
    const Rigid3 camera_from_world = RandomRigid3(generator);
    EXPECT_LT((camera_from_world * camera_from_world.OriginInSource()).norm(), 1e-13);
  });
}

TEST(Rigid3, MatrixActsOnHomogeneousPoints) {
  HoldsForManySeeds([](std::mt19937_64& generator) {
    const Rigid3 b_from_a = RandomRigid3(generator);
    const Eigen::Vector3d point = RandomPoint(generator);
    EXPECT_LT((b_from_a.Matrix() * point.homogeneous() - b_from_a * point).norm(), 1e-13);
  });
}

}  // namespace
}  // namespace antipode
