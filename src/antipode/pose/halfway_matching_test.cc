#include "antipode/pose/halfway_matching.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "antipode/geometry/rigid3.h"
#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kSide = 160;
const Eigen::Matrix3d kApart = RotationAboutZ(0.7) * RotationAboutY(0.8) * RotationAboutX(-0.3);

ObjectView Crop(double distance) {
  ObjectView view;
  view.distance = distance;
  view.image = cv::Mat(kSide, kSide, CV_8UC3, cv::Scalar::all(128));
  view.mask = cv::Mat(kSide, kSide, CV_8UC1, cv::Scalar(255));
  const double focal = 0.4 * kSide * distance;
  view.camera = {kSide, kSide, focal, focal, kSide / 2.0, kSide / 2.0};
  return view;
}

/// A pattern on the plane z = 0 of halfway axes, as the crop's camera sees it.
ObjectView CropOfPlane(double distance, const Eigen::Matrix3d& halfway_from_crop) {
  ObjectView view = Crop(distance);
  const Eigen::Matrix3d crop_from_halfway = halfway_from_crop.transpose();
  view.image.forEach<cv::Vec3b>([&](cv::Vec3b& color, const int* index) {
    const Eigen::Vector3d ray = view.camera.Ray({index[1] + 0.5, index[0] + 0.5});
    // The plane's point X has crop_from_halfway X + d e_z = s ray and X.z = 0.
    const Eigen::Vector3d normal = crop_from_halfway.col(2);
    const double depth = normal.z() * distance / normal.dot(ray);
    const Eigen::Vector3d point = halfway_from_crop * (depth * ray - distance * Eigen::Vector3d::UnitZ());
    const double wave = 0.5 + 0.25 * std::sin(9 * point.x()) + 0.25 * std::cos(7 * point.y() + point.x());
    color = cv::Vec3b::all(static_cast<std::uint8_t>(255 * wave));
  });
  return view;
}

double MeanDifferenceInTheMiddle(const cv::Mat& a, const cv::Mat& b) {
  const cv::Rect middle(kSide / 3, kSide / 3, kSide / 3, kSide / 3);
  cv::Mat difference;
  cv::absdiff(a(middle), b(middle), difference);
  return cv::mean(difference)[0];
}

/// Says that every fourth pixel of one picture shows what the same pixel of the other does.
class SamePixels : public Matcher {
 public:
  Correspondences Match(const cv::Mat& reference, const cv::Mat&) const override {
    ++calls;
    Correspondences all;
    for (int y = 2; y < reference.rows; y += 4)
      for (int x = 2; x < reference.cols; x += 4) {
        all.reference.emplace_back(x, y);
        all.query.emplace_back(x, y);
        all.scores.push_back(0.5);
      }
    return all;
  }
  mutable int calls = 0;
};

TEST(TurnHalfway, PutsBothCamerasEquallyFarToTheSides) {
  const HalfwayAxes axes = TurnHalfway(kApart);
  EXPECT_TRUE(axes.halfway_from_reference.isApprox(axes.halfway_from_query * kApart, 1e-12));
  EXPECT_NEAR(axes.halfway_from_reference.determinant(), 1, 1e-12);
  const Eigen::Vector3d reference = axes.halfway_from_reference.col(2), query = axes.halfway_from_query.col(2);
  EXPECT_NEAR(reference.x(), -query.x(), 1e-12);
  EXPECT_NEAR(reference.y(), -query.y(), 1e-12);
  EXPECT_NEAR(reference.z(), query.z(), 1e-12);
}

TEST(TurnHalfway, TurnsNothingWhereTheCropsAreAlike) {
  const HalfwayAxes axes = TurnHalfway(Eigen::Matrix3d::Identity());
  EXPECT_TRUE(axes.halfway_from_reference.isIdentity(1e-12));
  EXPECT_TRUE(axes.halfway_from_query.isIdentity(1e-12));
}

TEST(HalfwayView, ProjectsTheDomeOfItsHeader) {
  const ObjectView crop = Crop(4);
  const HalfwayOptions options{.dome_height = 0.5, .dome_radius = 1.3, .half_width = 1.2};
  const Eigen::Matrix3d turn = RotationAboutY(0.4);
  const HalfwayView view(crop, turn, options);
  for (const auto& pixel : {Eigen::Vector2d(80, 80), Eigen::Vector2d(30, 110), Eigen::Vector2d(1, 2)}) {
    const double x = 2.4 / kSide * (pixel.x() - 80), y = 2.4 / kSide * (pixel.y() - 80);
    const double z = -0.5 * std::max(0.0, 1 - (x * x + y * y) / (1.3 * 1.3));
    const Eigen::Vector3d in_crop = turn.transpose() * Eigen::Vector3d(x, y, z) + Eigen::Vector3d(0, 0, 4);
    EXPECT_LT((view.InCrop(pixel) - crop.camera.Project(in_crop)).norm(), 1e-9);
  }
}

TEST(HalfwayView, MakesPicturesOfAPlaneAlike) {
  const HalfwayAxes axes = TurnHalfway(kApart);
  const ObjectView reference = CropOfPlane(4, axes.halfway_from_reference), query = CropOfPlane(3, axes.halfway_from_query);
  const HalfwayOptions flat{.dome_height = 0};
  const cv::Mat a = HalfwayView(reference, axes.halfway_from_reference, flat).Image();
  const cv::Mat b = HalfwayView(query, axes.halfway_from_query, flat).Image();
  EXPECT_GT(MeanDifferenceInTheMiddle(reference.image, query.image), 20);
  EXPECT_LT(MeanDifferenceInTheMiddle(a, b), 2);
}

TEST(HalfwayView, IsWhiteWhereTheDomeFacesAway) {
  const ObjectView crop = Crop(4);
  const HalfwayOptions steep{.dome_height = 1.2, .dome_radius = 1};
  const cv::Mat image = HalfwayView(crop, RotationAboutY(1), steep).Image();
  const Eigen::Vector3d camera = -4 * RotationAboutY(1).col(2);
  ASSERT_LT(camera.x(), 0);  // so the right side is hidden
  EXPECT_EQ(image.at<cv::Vec3b>(kSide / 2, kSide / 2)[0], 128);
  EXPECT_EQ(image.at<cv::Vec3b>(kSide / 2, kSide / 2 + kSide / 3)[0], 255);
}

TEST(MatchHalfway, CarriesMatchesBackToTheCrops) {
  const ObjectView reference = Crop(4), query = Crop(5);
  const SamePixels matcher;
  const Correspondences found = MatchHalfway(matcher, reference, query, kApart);
  ASSERT_GT(found.size(), 100U);
  const Rigid3 pose{kApart, 5 * Eigen::Vector3d::UnitZ() - 4 * kApart.col(2)};
  const Eigen::Vector3d centre = -pose.rotation.transpose() * pose.translation;
  for (std::size_t i = 0; i < found.size(); ++i) {
    // One point seen by both cameras: the rays and the baseline lie in one plane.
    const Eigen::Vector3d a = reference.camera.Ray(found.reference[i]).normalized();
    const Eigen::Vector3d b = (pose.rotation.transpose() * query.camera.Ray(found.query[i])).normalized();
    EXPECT_NEAR(a.cross(b).dot(centre.normalized()), 0, 1e-9);
  }
}

TEST(MatchHalfway, KeepsWhatIsOnTheObjectInBoth) {
  const ObjectView reference = Crop(4);
  ObjectView query = Crop(4);
  query.mask(cv::Rect(0, 0, kSide / 2, kSide)).setTo(0);
  const Correspondences found = MatchHalfway(SamePixels(), reference, query, RotationAboutY(0.2));
  ASSERT_GT(found.size(), 50U);
  for (const Eigen::Vector2d& pixel : found.query) EXPECT_GE(pixel.x(), kSide / 2);
}

TEST(MatchHalfway, DoesNotMatchWhatHasNoSurfaceInCommon) {
  const ObjectView crop = Crop(4);
  const SamePixels matcher;
  EXPECT_EQ(MatchHalfway(matcher, crop, crop, RotationAboutY(2.5)).size(), 0U);
  EXPECT_EQ(MatchHalfway(matcher, crop, crop, RotationAboutX(std::numbers::pi)).size(), 0U);
  EXPECT_EQ(matcher.calls, 0);
}

TEST(MatchHalfway, RefusesImpossibleOptions) {
  const ObjectView crop = Crop(4);
  for (const HalfwayOptions& options : {HalfwayOptions{.dome_height = -1}, {.dome_radius = 0}, {.half_width = 0},
                                        {.least_facing = 1}, {.greatest_angle_deg = 180}})
    EXPECT_THROW(MatchHalfway(SamePixels(), crop, crop, kApart, options), InvalidOption);
}

}  // namespace
}  // namespace antipode
