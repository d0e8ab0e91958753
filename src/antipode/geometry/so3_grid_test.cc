#include "antipode/geometry/so3_grid.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/wigner.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

double DistanceDeg(const std::vector<Eigen::Matrix3d>& rotations, const Eigen::Matrix3d& target) {
  double nearest = 180;
  for (const Eigen::Matrix3d& rotation : rotations) nearest = std::min(nearest, AngleBetweenDeg(rotation, target));
  return nearest;
}

/// The mean of D_l over the uniform distribution is zero for every l > 0.
void ExpectToIntegrateTheWignerMatrices(const std::vector<Eigen::Matrix3d>& rotations, int max_degree) {
  const Eigen::RowVectorXf mean = WignerMatrices(rotations, max_degree).colwise().mean();
  EXPECT_NEAR(mean[0], 1, 1e-5);
  EXPECT_LT(mean.tail(mean.size() - 1).cwiseAbs().maxCoeff(), 0.01);
}

TEST(SuperFibonacci, IntegratesTheWignerMatricesToZero) { ExpectToIntegrateTheWignerMatrices(SuperFibonacciRotations(4096), 6); }

TEST(SuperFibonacci, CoversEveryRotation) {
  std::mt19937_64 random(5);
  const auto rotations = SuperFibonacciRotations(4096);
  for (int trial = 0; trial < 100; ++trial) EXPECT_LT(DistanceDeg(rotations, RandomRotation(random)), 16);
}

TEST(CubeSymmetricGrid, HasAboutAsManyRotationsAsWanted) {
  for (const int count : {2000, 4096, 21000}) EXPECT_NEAR(CubeSymmetricGrid(count).rotations().size(), count, 0.25 * count);
  EXPECT_THROW(CubeSymmetricGrid(0), InvalidOption);
  EXPECT_THROW(CubeSymmetricGrid(5), InvalidOption);
}

TEST(CubeSymmetricGrid, IntegratesTheWignerMatricesToZero) {
  ExpectToIntegrateTheWignerMatrices(CubeSymmetricGrid(21000).rotations(), 8);
}

TEST(CubeSymmetricGrid, CoversEveryRotation) {
  std::mt19937_64 random(6);
  const CubeSymmetricGrid grid(4096);
  for (int trial = 0; trial < 100; ++trial) EXPECT_LT(DistanceDeg(grid.rotations(), RandomRotation(random)), 16);
}

TEST(CubeSymmetricGrid, IsClosedUnderInversionAndTurnsFromBothSides) {
  const CubeSymmetricGrid grid(2000);
  const auto holds = [&](const Eigen::Matrix3d& rotation) { return DistanceDeg(grid.rotations(), rotation) < 1e-6; };
  ASSERT_EQ(grid.turns().size(), 24u);
  EXPECT_TRUE(grid.turns().front().isIdentity());
  for (std::size_t g = 0; g < grid.rotations().size(); g += 17) {
    const Eigen::Matrix3d& rotation = grid.rotations()[g];
    const Eigen::Matrix3d& turn = grid.turns()[g % 24];
    EXPECT_TRUE(holds(rotation.transpose()));
    EXPECT_TRUE(holds(rotation * turn));
    EXPECT_TRUE(holds(turn * rotation));
  }
}

TEST(CubeSymmetricGrid, ProductsAreThoseOfTheTurns) {
  const CubeSymmetricGrid grid(500);
  for (int m = 0; m < 24; ++m)
    for (int j = 0; j < 24; ++j) EXPECT_EQ(grid.turns()[grid.ProductOf(m, j)], grid.turns()[m] * grid.turns()[j]);
}

TEST(CubeSymmetricGrid, NeighboursOfTheCellGiveThoseOfEveryRotation) {
  const CubeSymmetricGrid grid(2000);
  const auto neighbours = grid.FindNeighbours(25);
  for (int i = 0; i < static_cast<int>(grid.cell().size()); i += 7) {
    const int j = i % 24;
    const Eigen::Matrix3d& here = grid.rotations()[grid.IndexOf(i, j)];
    const auto within = std::ranges::count_if(grid.rotations(), [&](const Eigen::Matrix3d& other) { return AngleBetweenDeg(here, other) <= 25; });
    EXPECT_EQ(neighbours[i].size() + 1, within);
    for (const auto& [cell, turn] : neighbours[i])
      EXPECT_LE(AngleBetweenDeg(here, grid.rotations()[grid.IndexOf(cell, grid.ProductOf(turn, j))]), 25 + 1e-3);
  }
}

}  // namespace
}  // namespace antipode
