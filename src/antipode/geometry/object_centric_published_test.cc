#include "antipode/geometry/object_centric_published.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/viewpoints.h"
#include "antipode/util/error.h"

namespace antipode::published {
namespace {

Eigen::Matrix3d Intrinsics(double focal_length, double centre_x, double centre_y) {
  Eigen::Matrix3d intrinsics;
  intrinsics << focal_length, 0, centre_x, 0, focal_length, centre_y, 0, 0, 1;
  return intrinsics;
}

/// A white picture with a dark rectangle of inclusive bounds.
std::vector<std::uint8_t> WhiteWithBox(int width, int height, const InclusiveBox& box) {
  std::vector<std::uint8_t> rgb(3 * width * height, 255);
  for (int y = int(box.y0); y <= int(box.y1); ++y) {
    for (int x = int(box.x0); x <= int(box.x1); ++x) rgb[3 * (y * width + x) + 1] = 249;
  }
  return rgb;
}

TEST(PublishedLookAt, WorkedExample) {
  const LookAt look_at = LookAtBox(Intrinsics(600, 320, 240), {400, 100, 520, 300});
  EXPECT_EQ(look_at.size, 220);
  EXPECT_NEAR(look_at.intrinsics(0, 0), 617.41396, 1e-5);
  Eigen::Matrix3d expected;
  expected << 0.973841, 0, -0.227230, 0.015115, 0.997785, 0.064779, 0.226726, -0.066519, 0.971684;
  EXPECT_LT((look_at.virtual_from_camera - expected).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((look_at.centre_in_virtual - Eigen::Vector2d(110.000, 111.072)).cwiseAbs().maxCoeff(),
            1e-3);
}

TEST(PublishedLookAt, IsExactOnTheImageAxes) {
  for (const double offset : {-200.0, -30.0, 0.0, 90.0, 210.0}) {
    const Eigen::Matrix3d intrinsics = Intrinsics(600, 320, 240);
    for (const Eigen::Vector2d& shift : {Eigen::Vector2d(offset, 0), Eigen::Vector2d(0, offset)}) {
      const LookAt look_at = LookAtBox(
          intrinsics, {270 + shift.x(), 190 + shift.y(), 370 + shift.x(), 290 + shift.y()});
      const Eigen::Vector2d middle = Eigen::Vector2d::Constant(look_at.size / 2.0);
      EXPECT_LT((look_at.centre_in_virtual - middle).norm(), 1e-9);
    }
  }
}

TEST(PublishedLookAt, NeedsABox) {
  EXPECT_THROW(LookAtBox(Intrinsics(600, 320, 240), {100, 100, 100, 100}), Error);
}

TEST(PublishedView, DistanceMakesTheSilhouetteSpanTwoUnits) {
  const InclusiveBox box{10, 20, 60, 45};
  const ViewCamera view = ViewCameraOf(WhiteWithBox(80, 80, box), 80, 80);
  EXPECT_EQ(view.box.x0, box.x0);
  EXPECT_EQ(view.box.y0, box.y0);
  EXPECT_EQ(view.box.x1, box.x1);
  EXPECT_EQ(view.box.y1, box.y1);
  EXPECT_NEAR(2 * view.intrinsics(0, 0) / view.distance, 50, 1e-12);
}

TEST(PublishedView, NearlyWhiteIsBackground) {
  const std::vector<std::uint8_t> rgb = WhiteWithBox(8, 8, {2, 2, 5, 5});
  EXPECT_EQ(NonWhiteBox(rgb, 8, 8, 5).x1, 5);
  EXPECT_THROW(NonWhiteBox(rgb, 8, 8, 6), Error);
}

TEST(PublishedPose, RelativePoseMovesObjectPointsFromCameraToCamera) {
  std::mt19937_64 generator(1);
  const LookAt reference = LookAtBox(Intrinsics(700, 320, 240), {100, 80, 300, 260});
  const LookAt query = LookAtBox(Intrinsics(650, 300, 250), {350, 200, 500, 420});
  for (int i = 0; i < 50; ++i) {
    const auto [reference_from_object, distance] =
        ReferencePoseOf(Intrinsics(700, 320, 240), reference, 0.1 + 0.02 * i, 0.3 - 0.01 * i);
    const Rigid3 query_from_object =
        CameraFromObject(query, {RandomRotation(generator), {0.1, -0.2, 4}});
    const Rigid3 query_from_reference =
        QueryFromReference(query_from_object, reference_from_object);
    const Eigen::Vector3d point(0.3, -0.5, 0.2);
    EXPECT_LT(
        (query_from_reference * (reference_from_object * point) - query_from_object * point).norm(),
        1e-12);
    EXPECT_NEAR(reference_from_object.OriginInSource().norm(), distance, 1e-12);
    EXPECT_NEAR(distance, 2 * 700.0 / reference.size, 1e-12);
  }
}

TEST(PublishedPose, ReferenceCameraStandsAtItsElevation) {
  const LookAt look_at = LookAtBox(Intrinsics(700, 320, 240), {270, 190, 370, 290});
  const auto [pose, distance] = ReferencePoseOf(Intrinsics(700, 320, 240), look_at, 0.4, 0.7);
  const Eigen::Vector3d expected = distance * Eigen::Vector3d(std::cos(0.4), 0, std::sin(0.4));
  EXPECT_LT((pose.OriginInSource() - expected).norm(), 1e-12);
}

}  // namespace
}  // namespace antipode::published
