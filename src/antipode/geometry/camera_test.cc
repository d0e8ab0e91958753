#include "antipode/geometry/camera.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "antipode/util/error.h"

namespace antipode {
namespace {

const PinholeCamera kCamera{640, 480, 600, 590, 310, 250};

std::string ReasonForRefusing(const PinholeCamera& camera) {
  try {
    camera.Check();
  } catch (const InvalidOption& error) {
    return error.what();
  }
  return "";
}

TEST(PinholeCamera, ProjectsThePointsOfARayToItsPixel) {
  std::mt19937_64 generator(1);
  std::uniform_real_distribution<double> pixel(-100, 740);
  std::uniform_real_distribution<double> depth(0.1, 20);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2d expected(pixel(generator), pixel(generator));
    const Eigen::Vector3d point = depth(generator) * kCamera.Ray(expected);
    EXPECT_LT((kCamera.Project(point) - expected).norm(), 1e-10);
  }
}

TEST(PinholeCamera, IntrinsicsProjectLikeProject) {
  const Eigen::Vector3d point(0.3, -0.2, 2.0);
  const Eigen::Vector3d homogeneous = kCamera.Intrinsics() * point;
  EXPECT_LT((homogeneous.hnormalized() - kCamera.Project(point)).norm(), 1e-12);
}

TEST(PinholeCamera, FieldOfViewSpansTheLongerSide) {
  for (const auto& [width, height] : {std::pair{640, 480}, std::pair{480, 640}}) {
    const PinholeCamera camera = PinholeCamera::FromFieldOfView(width, height, 50);
    const int longer = std::max(width, height);
    const double half_angle = std::atan2(longer / 2.0, camera.fx);
    EXPECT_NEAR(half_angle * 360 / M_PI, 50, 1e-12);
    EXPECT_EQ(camera.fx, camera.fy);
    EXPECT_EQ(camera.cx, width / 2.0);
    EXPECT_EQ(camera.cy, height / 2.0);
  }
}

TEST(PinholeCamera, FieldOfViewMustBeAnAngleOfAPinhole) {
  EXPECT_THROW(PinholeCamera::FromFieldOfView(640, 480, 0), InvalidOption);
  EXPECT_THROW(PinholeCamera::FromFieldOfView(640, 480, 180), InvalidOption);
  EXPECT_THROW(PinholeCamera::FromFieldOfView(640, 480, std::nan("")), InvalidOption);
  EXPECT_THROW(PinholeCamera::FromFieldOfView(0, 480, 50), InvalidOption);
}

TEST(PinholeCamera, ResizingScalesPixels) {
  const PinholeCamera half = kCamera.Resized(320, 120);
  const Eigen::Vector3d point(0.4, 0.1, 3.0);
  const Eigen::Vector2d full_pixel = kCamera.Project(point);
  EXPECT_LT((half.Project(point) - Eigen::Vector2d(full_pixel.x() / 2, full_pixel.y() / 4)).norm(),
            1e-12);
  EXPECT_EQ(half.width, 320);
  EXPECT_EQ(half.height, 120);
}

TEST(PinholeCamera, CheckNamesTheFieldAtFault) {
  EXPECT_EQ(ReasonForRefusing(kCamera), "");
  const auto refused = [](auto change) {
    PinholeCamera camera = kCamera;
    change(camera);
    return ReasonForRefusing(camera).substr(0, ReasonForRefusing(camera).find(':'));
  };
  EXPECT_EQ(refused([](PinholeCamera& camera) { camera.width = 0; }), "width");
  EXPECT_EQ(refused([](PinholeCamera& camera) { camera.height = -1; }), "height");
  EXPECT_EQ(refused([](PinholeCamera& camera) { camera.fx = 0; }), "fx");
  EXPECT_EQ(refused([](PinholeCamera& camera) { camera.fy = std::nan(""); }), "fy");
  EXPECT_EQ(refused([](PinholeCamera& camera) { camera.cx = 2.1 * camera.width; }), "cx");
  EXPECT_EQ(refused([](PinholeCamera& camera) { camera.cy = -1.1 * camera.height; }), "cy");
  EXPECT_EQ(refused([](PinholeCamera& camera) { camera.cx = HUGE_VAL; }), "cx");
}

}  // namespace
}  // namespace antipode
