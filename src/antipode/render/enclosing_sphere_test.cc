#include "antipode/render/enclosing_sphere.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace antipode {
namespace {

std::vector<Eigen::Vector3f> RandomPoints(std::mt19937& generator, int count) {
  std::uniform_real_distribution<float> coordinate(-1, 1);
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < count; ++i) {
    points.emplace_back(3 * coordinate(generator) + 5, coordinate(generator),
                        coordinate(generator));
  }
  return points;
}

double RadiusFrom(const Eigen::Vector3d& centre, const std::vector<Eigen::Vector3f>& points) {
  double largest = 0;
  for (const auto& point : points) {
    largest = std::max(largest, (point.cast<double>() - centre).norm());
  }
  return largest;
}

TEST(SmallestEnclosingSphere, HoldsEveryPointAndNoShiftOfItsCentreIsBetter) {
  std::mt19937 generator(3);
  std::normal_distribution<double> shift(0, 1);
  for (int count : {1, 2, 3, 4, 5, 10, 100, 1000}) {
    for (int i = 0; i < 20; ++i) {
      const auto points = RandomPoints(generator, count);
      const Sphere sphere = SmallestEnclosingSphere(points);
      EXPECT_NEAR(RadiusFrom(sphere.centre, points), sphere.radius, 1e-7);
      for (int j = 0; j < 20; ++j) {
        const Eigen::Vector3d direction(shift(generator), shift(generator), shift(generator));
        const Eigen::Vector3d moved = sphere.centre + 1e-3 * direction.normalized();
        EXPECT_GT(RadiusFrom(moved, points), sphere.radius);
      }
    }
  }
}

TEST(SmallestEnclosingSphere, OfPointsOnASphereIsThatSphere) {
  std::mt19937 generator(4);
  std::normal_distribution<float> normal(0, 1);
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3f direction(normal(generator), normal(generator), normal(generator));
    points.push_back(Eigen::Vector3f(1, -2, 3) + 0.5f * direction.normalized());
  }
  const Sphere sphere = SmallestEnclosingSphere(points);
  EXPECT_NEAR(sphere.radius, 0.5, 1e-6);
  EXPECT_LT((sphere.centre - Eigen::Vector3d(1, -2, 3)).norm(), 1e-5);
}

TEST(SmallestEnclosingSphere, OfDependentAndRepeatedPoints) {
  const std::vector<Eigen::Vector3f> line = {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {4, 0, 0}, {2, 0, 0}};
  const Sphere sphere = SmallestEnclosingSphere(line);
  EXPECT_NEAR(sphere.radius, 2, 1e-12);
  EXPECT_LT((sphere.centre - Eigen::Vector3d(2, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(SmallestEnclosingSphere({}).radius, 0);
  const std::vector<Eigen::Vector3f> same(7, Eigen::Vector3f(1, 1, 1));
  EXPECT_EQ(SmallestEnclosingSphere(same).radius, 0);
}

TEST(SmallestEnclosingSphere, OfACubeReachesItsCorners) {
  std::vector<Eigen::Vector3f> corners;
  for (int i = 0; i < 8; ++i) corners.emplace_back(i & 1, i >> 1 & 1, i >> 2 & 1);
  const Sphere sphere = SmallestEnclosingSphere(corners);
  EXPECT_NEAR(sphere.radius, std::sqrt(3.) / 2, 1e-12);
  EXPECT_LT((sphere.centre - Eigen::Vector3d::Constant(0.5)).norm(), 1e-12);
}

}  // namespace
}  // namespace antipode
