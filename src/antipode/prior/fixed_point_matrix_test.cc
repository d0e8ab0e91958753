#include "antipode/prior/fixed_point_matrix.h"

#include <random>

#include <gtest/gtest.h>

#include "antipode/util/error.h"

namespace antipode {
namespace {

RowMajorMatrixXf RandomRows(int rows, int columns, std::mt19937& random) {
  std::uniform_real_distribution<float> uniform(-1, 1);
  return RowMajorMatrixXf::NullaryExpr(rows, columns, [&] { return uniform(random); });
}

TEST(FixedPointMatrix, MultipliesWithinItsPrecision) {
  std::mt19937 random(1);
  for (const int columns : {1, 31, 32, 33, 969}) {
    const RowMajorMatrixXf first = RandomRows(2500, columns, random), second = RandomRows(7, columns, random);
    const Eigen::VectorXf vector = RandomRows(columns, 1, random);
    FixedPointMatrix matrix(columns);
    matrix.AppendRows(first);
    matrix.AppendRows(second);
    EXPECT_EQ(matrix.rows(), 2507);
    EXPECT_EQ(matrix.cols(), columns);
    const Eigen::VectorXf product = matrix * vector;
    const float bound = vector.lpNorm<1>() / 65534 + 1e-5f * vector.norm();
    EXPECT_LT((product.head(2500) - first * vector).cwiseAbs().maxCoeff(), bound);
    EXPECT_LT((product.tail(7) - second * vector).cwiseAbs().maxCoeff(), bound);
  }
}

TEST(FixedPointMatrix, KeepsTheEndsOfItsRange) {
  FixedPointMatrix matrix(2);
  matrix.AppendRows((RowMajorMatrixXf(2, 2) << 1, -1, 3, -3).finished());
  EXPECT_TRUE((matrix * Eigen::Vector2f(1, 1)).isZero(1e-6f));
  EXPECT_TRUE((matrix * Eigen::Vector2f(1, -1)).isApprox(Eigen::Vector2f(2, 2)));
}

TEST(FixedPointMatrix, RefusesOtherSizes) {
  FixedPointMatrix matrix(3);
  EXPECT_THROW(matrix.AppendRows(RowMajorMatrixXf::Zero(1, 2)), Error);
  EXPECT_THROW(matrix * Eigen::VectorXf::Zero(4), Error);
  EXPECT_EQ((matrix * Eigen::VectorXf::Zero(3)).size(), 0);
}

}  // namespace
}  // namespace antipode
