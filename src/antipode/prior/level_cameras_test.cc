#include "antipode/prior/level_cameras.h"

#include <gtest/gtest.h>

#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

Eigen::Matrix3d Between(const Viewpoint& reference, const Viewpoint& query) {
  return CameraRotationFromObject(query) * CameraRotationFromObject(reference).transpose();
}

TEST(LevelCameras, RolledCamerasAreUnlikely) {
  const double level = LogDensityOfLevelCameras(Between({.elevation = 20}, {.azimuth = 130, .elevation = 45}));
  const double rolled = LogDensityOfLevelCameras(Between({.elevation = 20}, {.azimuth = 130, .elevation = 45, .in_plane_rotation = 90}));
  EXPECT_GT(level, rolled + 3);
  EXPECT_LT(LogDensityOfLevelCameras(RotationAboutZ(3.0)), level - 3) << "upside down";
}

TEST(LevelCameras, SwappingThePicturesChangesNothing) {
  const Eigen::Matrix3d rotation = Between({.elevation = 5}, {.azimuth = 77, .elevation = 60, .in_plane_rotation = 12});
  EXPECT_NEAR(LogDensityOfLevelCameras(rotation), LogDensityOfLevelCameras(rotation.transpose()), 1e-9);
}

TEST(LevelCameras, AllAzimuthsAreAlike) {
  const double one = LogDensityOfLevelCameras(Between({.elevation = 30}, {.azimuth = 40, .elevation = 10}));
  EXPECT_NEAR(one, LogDensityOfLevelCameras(Between({.azimuth = 75, .elevation = 30}, {.azimuth = 115, .elevation = 10})), 1e-9);
  EXPECT_NEAR(one, LogDensityOfLevelCameras(Between({.elevation = 30}, {.azimuth = 200, .elevation = 10})), 1.0);
}

}  // namespace
}  // namespace antipode
