#include "antipode/image/draw.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace antipode {
namespace {

cv::Mat Canvas(int width = 200, int height = 160) { return {height, width, CV_8UC3, kWhite}; }

bool IsColour(const cv::Mat& canvas, int x, int y, const Colour& colour) {
  const cv::Vec3b expected(cv::saturate_cast<uchar>(colour[0]), cv::saturate_cast<uchar>(colour[1]),
                           cv::saturate_cast<uchar>(colour[2]));
  return cv::norm(canvas.at<cv::Vec3b>(y, x), expected, cv::NORM_INF) <= 40;
}

/// Centre of the darkness, pixel centres at integer + 0.5.
cv::Point2d DarkCentre(const cv::Mat& canvas) {
  cv::Mat grey;
  cv::cvtColor(canvas, grey, cv::COLOR_RGB2GRAY);
  const cv::Moments moments = cv::moments(~grey);
  return {moments.m10 / moments.m00 + 0.5, moments.m01 / moments.m00 + 0.5};
}

TEST(DrawLine, PutsTheLineWhereItIsAsked) {
  cv::Mat canvas = Canvas();
  DrawLine(canvas, {20.5, 30.25}, {120.5, 90.25}, {.thickness = 3});
  EXPECT_LT(cv::norm(DarkCentre(canvas) - cv::Point2d(70.5, 60.25)), 0.3);
}

TEST(BlendDisc, MixesColoursByOpacity) {
  cv::Mat canvas = Canvas();
  BlendDisc(canvas, {50, 60}, 10, kBlack, 0.5);
  EXPECT_NEAR(canvas.at<cv::Vec3b>(60, 50)[0], 127, 1);
  EXPECT_EQ(canvas.at<cv::Vec3b>(60, 70)[0], 255);
  EXPECT_LT(cv::norm(DarkCentre(canvas) - cv::Point2d(50, 60)), 0.02);
}

TEST(DrawArrow, HasItsTipAtTheTargetInTheGivenColour) {
  cv::Mat canvas = Canvas();
  DrawArrow(canvas, {20, 80}, {120, 80}, "", {.colour = kRed, .thickness = 2});
  EXPECT_TRUE(IsColour(canvas, 70, 79, kRed));
  EXPECT_TRUE(IsColour(canvas, 114, 79, kRed));
  EXPECT_TRUE(IsColour(canvas, 124, 79, kWhite));
}

TEST(DrawText, FitsItsMeasure) {
  cv::Mat canvas = Canvas();
  const TextStyle style{.height = 14};
  DrawText(canvas, "TILT", {30, 60}, style);
  cv::Mat grey;
  cv::cvtColor(canvas, grey, cv::COLOR_RGB2GRAY);
  const cv::Rect ink = cv::boundingRect(grey < 200);
  const cv::Size2d size = MeasureText("TILT", style);
  EXPECT_NEAR(ink.height, 14, 3);
  EXPECT_NEAR(ink.br().y, 60, 2);
  EXPECT_NEAR(ink.width, size.width, 4);
}

TEST(DrawProbabilityBar, FillsItsShare) {
  for (const double probability : {-1.0, 0.0, 0.25, 1.0, 7.0, std::nan("")}) {
    cv::Mat canvas = Canvas();
    DrawProbabilityBar(canvas, {10, 10, 100, 8}, probability, kBlack);
    const double share = probability > 0 ? std::min(probability, 1.0) : 0.0;
    cv::Mat grey;
    cv::cvtColor(canvas, grey, cv::COLOR_RGB2GRAY);
    EXPECT_EQ(cv::countNonZero(grey == 0), 800 * share) << probability;
  }
}

TEST(SideBySide, KeepsEveryPicture) {
  const cv::Mat left(40, 30, CV_8UC3, kRed), right(20, 50, CV_8UC1, cv::Scalar(77));
  const cv::Mat row = SideBySide({left, right}, 5);
  EXPECT_EQ(row.size(), cv::Size(5 + 30 + 5 + 50 + 5, 50));
  EXPECT_TRUE(IsColour(row, 5, 5, kRed));
  EXPECT_TRUE(IsColour(row, 4, 5, kWhite));
  EXPECT_EQ(row.at<cv::Vec3b>(25, 60), cv::Vec3b(77, 77, 77));
  EXPECT_EQ(row.at<cv::Vec3b>(14, 60), cv::Vec3b(255, 255, 255));
}

TEST(DrawAxes, DrawsProjectedAxesInTheirColours) {
  cv::Mat canvas = Canvas(200, 200);
  const PinholeCamera camera{200, 200, 200, 200, 100, 100};
  Eigen::Matrix3d camera_from_object;
  camera_from_object << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  DrawAxes(canvas, camera, {.camera_from_object = camera_from_object, .distance = 4, .length = 1});
  EXPECT_TRUE(IsColour(canvas, 130, 100, kRed));
  EXPECT_TRUE(IsColour(canvas, 100, 70, kGreen));
}

TEST(DrawAxes, DrawsNothingBehindTheCamera) {
  cv::Mat canvas = Canvas();
  const PinholeCamera camera{200, 160, 200, 200, 100, 80};
  const Eigen::Matrix3d facing = Eigen::Vector3d(1, -1, -1).asDiagonal();
  DrawAxes(canvas, camera, {.camera_from_object = facing, .distance = 0.5, .length = 1});
  DrawAxes(canvas, camera, {.camera_from_object = facing, .distance = -3, .length = 1});
  EXPECT_EQ(cv::norm(canvas, Canvas(), cv::NORM_INF), 0);
}

TEST(DrawViewSphere, PutsNearDotsWhereTheirDirectionProjects) {
  cv::Mat canvas = Canvas(200, 200);
  ViewSphere sphere{.centre = {100, 100},
                    .radius = 80,
                    .viewer_azimuth_deg = 0,
                    .viewer_elevation_deg = 0,
                    .dots = {}};
  sphere.dots = {{{1, 0, 1}, kRed, ""}, {{0, 1, 0.2}, kGreen, ""}, {{-1, 0, -1}, kBlue, ""}};
  DrawViewSphere(canvas, sphere);
  const int offset = static_cast<int>(80 / std::sqrt(2));
  EXPECT_TRUE(IsColour(canvas, 100 + offset, 100, kRed));
  EXPECT_TRUE(IsColour(canvas, 100, 100 - 78, kGreen));
  EXPECT_FALSE(IsColour(canvas, 100 - offset, 98, kBlue)) << "a dot on the far side is paler";
  EXPECT_FALSE(IsColour(canvas, 100 - offset, 98, kWhite));
}

TEST(Drawing, CutsOffWhatLiesOutsideAndIgnoresWhatIsNotFinite) {
  const double infinity = std::numeric_limits<double>::infinity();
  cv::Mat canvas = Canvas();
  for (const cv::Point2d point : {cv::Point2d(-1e9, 1e12), cv::Point2d(infinity, 3),
                                  cv::Point2d(std::nan(""), 5), cv::Point2d(300, -80)}) {
    DrawLine(canvas, point, point * 2);
    DrawArrow(canvas, point, point + cv::Point2d(1, 1), "label");
    DrawText(canvas, "text", point);
    BlendDisc(canvas, point, 4, kRed, 1);
    DrawViewSphere(canvas, {.centre = point, .radius = 30, .dots = {{{0, 0, 1}, kRed, "a"}}});
  }
  DrawProbabilityBar(canvas, {-500, -20, 30, 10}, 0.5);
  DrawProbabilityBar(canvas, {190, 150, 300, 100}, 0.5, kRed);
  EXPECT_TRUE(IsColour(canvas, 195, 155, kRed));
  EXPECT_TRUE(IsColour(canvas, 10, 150, kWhite));
}

}  // namespace
}  // namespace antipode
