#include "antipode/image/mask.h"

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>
#include <string>

#include "antipode/util/temporary_folder.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kWidth = 320, kHeight = 240;

cv::Mat Plain(const cv::Scalar& colour) { return {kHeight, kWidth, CV_8UC3, colour}; }

cv::Mat Ellipse() {
  cv::Mat mask = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
  cv::ellipse(mask, {150, 120}, {70, 45}, 20, 0, 360, 255, cv::FILLED);
  return mask;
}

/// `colour` with noise where `mask` is set, on a plain background.
LoadedImage ObjectOn(const cv::Scalar& background, const cv::Mat& mask, const cv::Scalar& colour) {
  LoadedImage image{.rgb = Plain(background), .alpha = {}, .exif_focal_px = {}};
  cv::Mat object = Plain(colour);
  cv::Mat noise(object.size(), CV_8UC3);
  cv::RNG(5).fill(noise, cv::RNG::UNIFORM, 0, 30);
  object += noise;
  object.copyTo(image.rgb, mask);
  return image;
}

double IntersectionOverUnion(const cv::Mat& a, const cv::Mat& b) {
  return cv::countNonZero(a & b) / static_cast<double>(cv::countNonZero(a | b));
}

std::string ReasonForFailing(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(FindObjectMask, FindsTheObjectOnAnyPlainBackground) {
  const cv::Scalar backgrounds[] = {{255, 255, 255}, {0, 0, 0}, {60, 140, 90}};
  for (const cv::Scalar& background : backgrounds) {
    LoadedImage image = ObjectOn(background, Ellipse(), {180, 40, 160});
    cv::Mat noise(image.rgb.size(), CV_8UC3);
    cv::RNG(6).fill(noise, cv::RNG::NORMAL, 0, 2);
    image.rgb += noise;
    const ObjectMask found = FindObjectMask(image, {}, "a.png");
    EXPECT_EQ(found.source, "background");
    EXPECT_TRUE(found.warnings.empty());
    EXPECT_GT(IntersectionOverUnion(found.mask, Ellipse()), 0.97) << background;
    EXPECT_EQ(cv::countNonZero(found.mask == 255) + cv::countNonZero(found.mask == 0),
              kWidth * kHeight);
  }
}

TEST(FindObjectMask, FillsSmallWhitePartsButKeepsRealHoles) {
  LoadedImage image = ObjectOn({255, 255, 255}, Ellipse(), {30, 60, 90});
  cv::circle(image.rgb, {150, 120}, 5, {255, 255, 255}, cv::FILLED);
  EXPECT_EQ(FindObjectMask(image, {}, "a").mask.at<uchar>(120, 150), 255);
  cv::circle(image.rgb, {150, 120}, 25, {255, 255, 255}, cv::FILLED);
  EXPECT_EQ(FindObjectMask(image, {}, "a").mask.at<uchar>(120, 150), 0);
}

TEST(FindObjectMask, RefusesAClutteredBackgroundAndNamesTheWayOut) {
  LoadedImage image = ObjectOn({0, 0, 0}, Ellipse(), {200, 200, 200});
  cv::RNG(8).fill(image.rgb, cv::RNG::UNIFORM, 0, 256);
  const std::string reason = ReasonForFailing([&] { FindObjectMask(image, {}, "cat.jpg"); });
  EXPECT_TRUE(reason.starts_with("cat.jpg: "));
  EXPECT_NE(reason.find("--reference-mask/--query-mask FILE"), std::string::npos);
  EXPECT_NE(reason.find("--reference-box/--query-box x,y,w,h"), std::string::npos);

  cv::Mat gradient(kHeight, kWidth, CV_8UC3);
  for (int x = 0; x < kWidth; ++x) gradient.col(x).setTo(cv::Scalar::all(x * 0.7));
  EXPECT_NE(ReasonForFailing([&] { FindObjectMask({gradient, {}, {}}, {}, "b"); }), "");
}

TEST(FindObjectMask, RefusesABackgroundWithoutAnObject) {
  EXPECT_NE(ReasonForFailing([] {
              FindObjectMask({Plain({9, 9, 9}), {}, {}}, {}, "b");
            }).find("marks no pixel"),
            std::string::npos);
}

TEST(FindObjectMask, PrefersFileThenBoxThenAlpha) {
  const TemporaryFolder folder;
  SaveImage(folder.path() / "mask.png", Ellipse());
  LoadedImage image = ObjectOn({255, 255, 255}, Ellipse(), {30, 60, 90});
  image.alpha = Ellipse();
  const MaskRequest both{.file = folder.path() / "mask.png", .box = cv::Rect(60, 50, 180, 140)};
  EXPECT_EQ(FindObjectMask(image, both, "a").source, "file");
  EXPECT_EQ(cv::norm(FindObjectMask(image, both, "a").mask, Ellipse(), cv::NORM_INF), 0);
  EXPECT_EQ(FindObjectMask(image, {.file = {}, .box = both.box}, "a").source, "box");
  EXPECT_EQ(FindObjectMask(image, {}, "a").source, "alpha");
  EXPECT_EQ(cv::norm(FindObjectMask(image, {}, "a").mask, Ellipse(), cv::NORM_INF), 0);
}

TEST(FindObjectMask, TakesColouredMaskFiles) {
  const TemporaryFolder folder;
  cv::Mat red = Plain({0, 0, 0});
  red.setTo(cv::Scalar(200, 0, 0), Ellipse());
  SaveImage(folder.path() / "red.png", red);
  const LoadedImage image = ObjectOn({255, 255, 255}, Ellipse(), {30, 60, 90});
  const ObjectMask found =
      FindObjectMask(image, {.file = folder.path() / "red.png", .box = {}}, "a");
  EXPECT_EQ(cv::norm(found.mask, Ellipse(), cv::NORM_INF), 0);
}

TEST(FindObjectMask, RefusesUnusableMaskFiles) {
  const TemporaryFolder folder;
  const LoadedImage image = ObjectOn({255, 255, 255}, Ellipse(), {30, 60, 90});
  const auto reason_for = [&](const cv::Mat& mask) {
    SaveImage(folder.path() / "mask.png", mask);
    return ReasonForFailing(
        [&] { FindObjectMask(image, {.file = folder.path() / "mask.png", .box = {}}, "a"); });
  };
  EXPECT_NE(reason_for(Ellipse().t()).find("240 x 320"), std::string::npos);
  EXPECT_NE(reason_for(Ellipse() / 255).find("highest value is 1"), std::string::npos);
  EXPECT_NE(reason_for(cv::Mat::zeros(kHeight, kWidth, CV_8UC1)), "");
  EXPECT_NE(reason_for(Ellipse() | 255).find("every pixel"), std::string::npos);
  EXPECT_EQ(reason_for(Ellipse()), "");
}

TEST(FindObjectMask, KeepsTheLargestBlobWithAWarning) {
  LoadedImage image = ObjectOn({255, 255, 255}, Ellipse(), {30, 60, 90});
  image.alpha = Ellipse();
  cv::rectangle(image.alpha, {280, 10, 30, 30}, 255, cv::FILLED);
  const ObjectMask two = FindObjectMask(image, {}, "a");
  EXPECT_EQ(cv::norm(two.mask, Ellipse(), cv::NORM_INF), 0);
  ASSERT_EQ(two.warnings.size(), 1u);
  EXPECT_NE(two.warnings[0].find("2 separate parts"), std::string::npos);
  cv::rectangle(image.alpha, {100, 100, 220, 60}, 255, cv::FILLED);
  const ObjectMask at_border = FindObjectMask(image, {}, "a");
  ASSERT_FALSE(at_border.warnings.empty());
  EXPECT_NE(at_border.warnings.back().find("border"), std::string::npos);
}

TEST(FindObjectMask, CutsTheObjectOutOfABoxInACluttedPicture) {
  LoadedImage image = ObjectOn({0, 0, 0}, Ellipse(), {210, 40, 40});
  cv::Mat clutter(image.rgb.size(), CV_8UC3);
  cv::RNG(9).fill(clutter, cv::RNG::UNIFORM, 20, 160);
  cv::GaussianBlur(clutter, clutter, {}, 2);
  clutter.copyTo(image.rgb, ~Ellipse());
  const MaskRequest request{.file = {}, .box = cv::Rect(70, 60, 160, 120)};
  const ObjectMask found = FindObjectMask(image, request, "a");
  EXPECT_GT(IntersectionOverUnion(found.mask, Ellipse()), 0.95);
  EXPECT_EQ(cv::norm(found.mask, FindObjectMask(image, request, "a").mask, cv::NORM_INF), 0);

  LoadedImage large;
  cv::resize(image.rgb, large.rgb, {}, 5, 5, cv::INTER_LINEAR);
  cv::Mat large_ellipse;
  cv::resize(Ellipse(), large_ellipse, {}, 5, 5, cv::INTER_NEAREST);
  const MaskRequest large_request{.file = {}, .box = cv::Rect(350, 300, 800, 600)};
  EXPECT_GT(IntersectionOverUnion(FindObjectMask(large, large_request, "a").mask, large_ellipse),
            0.95);
}

TEST(FindObjectMask, RefusesUnusableBoxes) {
  const LoadedImage image = ObjectOn({255, 255, 255}, Ellipse(), {30, 60, 90});
  const auto reason_for = [&](const cv::Rect& box) {
    return ReasonForFailing([&] { FindObjectMask(image, {.file = {}, .box = box}, "a"); });
  };
  EXPECT_NE(reason_for({0, 0, kWidth, kHeight}).find("whole image"), std::string::npos);
  EXPECT_NE(reason_for({400, 10, 50, 50}), "");
  EXPECT_NE(reason_for({10, 10, 3, 50}), "");
  EXPECT_NE(reason_for({10, 10, -30, 50}), "");
  EXPECT_NE(reason_for({INT_MAX, INT_MAX, INT_MAX, INT_MAX}), "");
}

TEST(MaskBox, SpansThePixelsOverTheThreshold) {
  cv::Mat mask = cv::Mat::zeros(50, 60, CV_8UC1);
  EXPECT_THROW(MaskBox(mask), Error);
  mask.at<uchar>(3, 4) = 126;
  mask.at<uchar>(20, 30) = 255;
  mask.at<uchar>(40, 50) = 125;
  EXPECT_EQ(MaskBox(mask), cv::Rect2d(4, 3, 27, 18));
}

}  // namespace
}  // namespace antipode
