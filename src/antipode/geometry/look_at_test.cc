#include "antipode/geometry/look_at.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

/// Difference of two angles in degrees, in -180..180.
double AngleDifference(double a, double b) { return std::remainder(a - b, 360.0); }

Viewpoint RandomViewpoint(std::mt19937_64& generator) {
  std::uniform_real_distribution<double> azimuth(0, 360), elevation(-89.9, 89.9), roll(-179, 179),
      distance(1.5, 10);
  return {azimuth(generator), elevation(generator), roll(generator), distance(generator)};
}

TEST(LookAt, FrontCameraSeesTheObjectUpright) {
  const Rigid3 pose = CameraFromObject({.azimuth = 0, .elevation = 0, .distance = 4});
  EXPECT_LT((pose.OriginInSource() - Eigen::Vector3d(0, 0, 4)).norm(), 1e-15);
  EXPECT_LT((pose * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 0, 4)).norm(), 1e-15);
  EXPECT_LT((pose * Eigen::Vector3d(0, 1, 0) - Eigen::Vector3d(0, -1, 4)).norm(), 1e-15);
}

TEST(LookAt, AzimuthMovesTheCameraToItsRightAndElevationUp) {
  const Eigen::Vector3d right = CameraFromObject({.azimuth = 90, .distance = 2}).OriginInSource();
  EXPECT_LT((right - Eigen::Vector3d(2, 0, 0)).norm(), 1e-15);
  const Eigen::Vector3d above = CameraFromObject({.elevation = 90, .distance = 2}).OriginInSource();
  EXPECT_LT((above - Eigen::Vector3d(0, 2, 0)).norm(), 1e-15);
}

TEST(LookAt, PositiveInPlaneRotationTurnsThePictureClockwise) {
  const Rigid3 pose = CameraFromObject({.in_plane_rotation = 90, .distance = 4});
  // The object's right goes to the bottom of the picture (y down).
  EXPECT_LT((pose * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 1, 4)).norm(), 1e-15);
}

TEST(LookAt, CameraCentreFollowsTheFormula) {
  std::mt19937_64 generator(1);
  for (int i = 0; i < 200; ++i) {
    const Viewpoint view = RandomViewpoint(generator);
    const double a = RadiansFromDegrees(view.azimuth), e = RadiansFromDegrees(view.elevation);
    const Eigen::Vector3d centre =
        view.distance *
        Eigen::Vector3d(std::cos(e) * std::sin(a), std::sin(e), std::cos(e) * std::cos(a));
    const Rigid3 pose = CameraFromObject(view);
    EXPECT_LT((pose.OriginInSource() - centre).norm(), 1e-13);
    EXPECT_LT((pose.translation - Eigen::Vector3d(0, 0, view.distance)).norm(), 1e-15);
    EXPECT_NEAR(pose.rotation.determinant(), 1, 1e-13);
    EXPECT_LT((pose.rotation * pose.rotation.transpose() - Eigen::Matrix3d::Identity()).norm(),
              1e-13);
  }
}

TEST(LookAt, UprightCameraKeepsTheHorizonLevel) {
  std::mt19937_64 generator(2);
  for (int i = 0; i < 200; ++i) {
    Viewpoint view = RandomViewpoint(generator);
    view.in_plane_rotation = 0;
    const Eigen::Vector3d up = CameraRotationFromObject(view) * Eigen::Vector3d::UnitY();
    EXPECT_NEAR(up.x(), 0, 1e-15);
    EXPECT_LT(up.y(), 0);
  }
}

TEST(LookAt, ViewpointRoundTrip) {
  std::mt19937_64 generator(3);
  for (int i = 0; i < 200; ++i) {
    const Viewpoint view = RandomViewpoint(generator);
    const Viewpoint found = ViewpointFromRotation(CameraRotationFromObject(view), view.distance);
    EXPECT_NEAR(AngleDifference(found.azimuth, view.azimuth), 0, 1e-9);
    EXPECT_NEAR(found.elevation, view.elevation, 1e-9);
    EXPECT_NEAR(AngleDifference(found.in_plane_rotation, view.in_plane_rotation), 0, 1e-9);
    EXPECT_EQ(found.distance, view.distance);
  }
}

TEST(LookAt, RotationRoundTripWithAnglesInRange) {
  std::mt19937_64 generator(4);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Matrix3d rotation = RandomRotation(generator);
    const Viewpoint view = ViewpointFromRotation(rotation);
    EXPECT_LT((CameraRotationFromObject(view) - rotation).norm(), 1e-13);
    EXPECT_GE(view.azimuth, 0);
    EXPECT_LT(view.azimuth, 360);
    EXPECT_LE(std::abs(view.elevation), 90);
    EXPECT_LE(std::abs(view.in_plane_rotation), 180);
  }
}

TEST(LookAt, RotationRoundTripAtAndNearThePoles) {
  for (const double elevation : {-90.0, -90 + 1e-9, 90 - 1e-13, 90.0}) {
    for (int azimuth = 0; azimuth < 360; azimuth += 15) {
      const Eigen::Matrix3d rotation = CameraRotationFromObject(
          {.azimuth = double(azimuth), .elevation = elevation, .in_plane_rotation = 20});
      EXPECT_TRUE(rotation.allFinite());
      EXPECT_LT((CameraRotationFromObject(ViewpointFromRotation(rotation)) - rotation).norm(),
                1e-13);
    }
  }
  Eigen::Matrix3d from_above;
  from_above << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const Viewpoint view = ViewpointFromRotation(from_above);
  EXPECT_EQ(view.azimuth, 0);
  EXPECT_NEAR(view.elevation, 90, 1e-12);
  EXPECT_LT((CameraRotationFromObject(view) - from_above).norm(), 1e-15);
}

}  // namespace
}  // namespace antipode
