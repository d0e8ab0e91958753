#include "antipode/geometry/viewpoints.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

TEST(PredefinedViewpoints, RiseInEqualStepsOfHeight) {
  for (const int count : {1, 5, 8, 128}) {
    const auto viewpoints = PredefinedViewpoints(count);
    ASSERT_EQ(viewpoints.size(), std::size_t(count));
    for (int i = 0; i < count; ++i) {
      EXPECT_NEAR(std::sin(viewpoints[i].elevation), double(i) / count, 1e-15);
      EXPECT_GE(viewpoints[i].azimuth, 0);
      EXPECT_LT(viewpoints[i].azimuth, 2 * std::numbers::pi);
    }
  }
}

TEST(PredefinedViewpoints, TurnByTheGoldenAngle) {
  const auto viewpoints = PredefinedViewpoints(64);
  const double turn = std::numbers::pi * (std::sqrt(5.0) - 1);
  for (std::size_t i = 1; i < viewpoints.size(); ++i) {
    const double step = viewpoints[i].azimuth - viewpoints[i - 1].azimuth - turn;
    EXPECT_NEAR(std::remainder(step, 2 * std::numbers::pi), 0, 1e-12);
  }
}

TEST(PredefinedViewpoints, NeedAtLeastOne) {
  EXPECT_THROW(PredefinedViewpoints(0), InvalidOption);
  EXPECT_THROW(PredefinedViewpoints(-3), InvalidOption);
}

TEST(CanonicalCamera, WorkedExample) {
  const Rigid3 pose = CameraFromCanonical(
      {.elevation = RadiansFromDegrees(30), .azimuth = RadiansFromDegrees(60)}, 4);
  Eigen::Matrix3d expected;
  expected << -0.866025, 0.5, 0, 0.25, 0.433013, -0.866025, -0.433013, -0.75, -0.5;
  EXPECT_LT((pose.rotation - expected).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((pose.OriginInSource() - Eigen::Vector3d(1.7321, 3, 2)).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(CanonicalCamera, AgreesWithTheObjectFrame) {
  std::mt19937_64 generator(1);
  std::uniform_real_distribution<double> azimuth(0, 360), elevation(-90, 90);
  for (int i = 0; i < 200; ++i) {
    const Viewpoint view{.azimuth = azimuth(generator), .elevation = elevation(generator)};
    const Eigen::Matrix3d canonical = CameraRotationFromCanonical(
        {RadiansFromDegrees(view.elevation), RadiansFromDegrees(view.azimuth)});
    EXPECT_LT((canonical * CanonicalFromObjectRotation() - CameraRotationFromObject(view)).norm(),
              1e-14);
  }
}

TEST(CanonicalCamera, ObjectUpIsCanonicalUp) {
  EXPECT_EQ(CanonicalFromObjectRotation() * Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ());
  EXPECT_EQ(CanonicalFromObjectRotation() * Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX());
  EXPECT_NEAR(RotationAngleDeg(CanonicalFromObjectRotation()), 120.0, 1e-12);
}

TEST(RelativeView, PointsDownForLowerViews) {
  const RelativeView lower =
      RelativeViewOf({.elevation = RadiansFromDegrees(10), .azimuth = RadiansFromDegrees(200)}, 30);
  EXPECT_NEAR(lower.polar, 20, 1e-12);
  EXPECT_NEAR(lower.azimuth, 200, 1e-12);
  EXPECT_EQ(lower.radius, 0);
}

TEST(FarthestPointOrder, LosesOnePointAndRepeatsNone) {
  std::mt19937_64 generator(2);
  for (const int count : {1, 2, 3, 40}) {
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < count; ++i) {
      points.push_back(RandomRotation(generator) * Eigen::Vector3d::UnitX());
    }
    const auto order = FarthestPointOrder(points);
    EXPECT_EQ(order.size(), std::size_t(count - 1));
    EXPECT_EQ(std::set<std::size_t>(order.begin(), order.end()).size(), order.size());
  }
  EXPECT_TRUE(FarthestPointOrder({}).empty());
}

TEST(FarthestPointOrder, TakesEachTimeThePointFarthestFromTheTaken) {
  std::mt19937_64 generator(3);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 30; ++i)
    points.push_back(RandomRotation(generator) * Eigen::Vector3d::UnitX());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& point : points) mean += point / double(points.size());

  std::vector<Eigen::Vector3d> taken = {mean};
  const auto distance_to_taken = [&](const Eigen::Vector3d& point) {
    double nearest = HUGE_VAL;
    for (const auto& one : taken) nearest = std::min(nearest, (point - one).norm());
    return nearest;
  };
  for (const std::size_t index : FarthestPointOrder(points)) {
    double farthest = 0;
    for (const auto& point : points) farthest = std::max(farthest, distance_to_taken(point));
    EXPECT_NEAR(distance_to_taken(points[index]), farthest, 1e-12);
    taken.push_back(points[index]);
  }
}

TEST(FarthestPointOrder, StartsFromTheMean) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {1, 0, 0}, {10, 0, 0}, {2, 0, 0}};
  // The mean is 3.25: first 10, then 0, and of 1 and 2 the first on the tie.
  EXPECT_EQ(FarthestPointOrder(points), (std::vector<std::size_t>{2, 0, 3}));
}

}  // namespace
}  // namespace antipode
