#include "antipode/image/degradation.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace antipode {
namespace {

cv::Mat Dot() {
  cv::Mat picture = cv::Mat::zeros(41, 41, CV_8UC3);
  picture.at<cv::Vec3b>(20, 20) = {250, 250, 250};
  return picture;
}

cv::Rect BoxOf(const cv::Mat& picture) {
  cv::Mat channel;
  cv::extractChannel(picture, channel, 1);
  return cv::boundingRect(channel > 0);
}

TEST(MotionBlurred, SmearsAlongTheLine) {
  const cv::Rect across = BoxOf(MotionBlurred(Dot(), 10, 0)), down = BoxOf(MotionBlurred(Dot(), 10, 90));
  EXPECT_NEAR(across.width, 11, 2);
  EXPECT_LE(across.height, 3);
  EXPECT_EQ(across.width, down.height);
  EXPECT_EQ(across.x + across.width / 2, 20);
  const cv::Mat plain(30, 30, CV_8UC4, cv::Scalar(10, 90, 200, 255));
  EXPECT_LE(cv::norm(MotionBlurred(plain, 7, 33), plain, cv::NORM_INF), 1) << "what is the same everywhere stays so";
}

TEST(WithNoise, HasTheDeviationAskedFor) {
  const cv::Mat grey(200, 200, CV_8UC3, cv::Scalar::all(128)), noisy = WithNoise(grey, 12, 5);
  cv::Scalar mean, deviation;
  cv::meanStdDev(noisy, mean, deviation);
  EXPECT_NEAR(mean[1], 128, 0.5);
  EXPECT_NEAR(deviation[1], 12, 0.5);
  EXPECT_EQ(cv::norm(noisy, WithNoise(grey, 12, 5)), 0) << "depends on the seed alone";
  EXPECT_GT(cv::norm(noisy, WithNoise(grey, 12, 6)), 0);
}

TEST(AfterJpeg, LosesMoreAtLowerQuality) {
  cv::Mat picture;
  cv::cvtColor(WithNoise(cv::Mat(64, 64, CV_8U, cv::Scalar(128)), 20, 1), picture, cv::COLOR_GRAY2RGB);
  const double good = cv::norm(AfterJpeg(picture, 95), picture), bad = cv::norm(AfterJpeg(picture, 10), picture);
  EXPECT_GT(good, 0);
  EXPECT_GT(bad, 2 * good);
}

TEST(CutOff, TakesAStripOfTheBox) {
  cv::Mat mask = cv::Mat::zeros(60, 100, CV_8U);
  cv::rectangle(mask, cv::Rect(40, 20, 20, 10), cv::Scalar(255), cv::FILLED);
  const auto rest = [&](PictureSide side) { return cv::boundingRect(CutOff(mask, side, 0.2)); };
  EXPECT_EQ(rest(PictureSide::kLeft), cv::Rect(44, 20, 16, 10));
  EXPECT_EQ(rest(PictureSide::kRight), cv::Rect(40, 20, 16, 10));
  EXPECT_EQ(rest(PictureSide::kTop), cv::Rect(40, 22, 20, 8));
  EXPECT_EQ(rest(PictureSide::kBottom), cv::Rect(40, 20, 20, 8));
  EXPECT_EQ(cv::boundingRect(mask), cv::Rect(40, 20, 20, 10)) << "the given mask stays as it is";
}

}  // namespace
}  // namespace antipode
