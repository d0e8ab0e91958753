#include "antipode/matching/sift.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

/// Blobs of several sizes: sums of smoothed noise.
cv::Mat Texture(int width, int height) {
  const auto uniform = SyntheticUniform("texture", {height, width, 3}).to(torch::kFloat);
  const cv::Mat noise(height, width, CV_32FC3, uniform.data_ptr());
  cv::Mat sum = cv::Mat::zeros(height, width, CV_32FC3), smooth, texture;
  for (const double deviation : {1.5, 3.0, 6.0}) {
    cv::GaussianBlur(noise, smooth, {}, deviation);
    sum += deviation * smooth;
  }
  cv::normalize(sum, texture, 0, 255, cv::NORM_MINMAX, CV_8U);
  return texture;
}

/// Turned, scaled and tilted, from pixels with centres at integer + 0.5 to such.
Eigen::Matrix3d QueryFromReference() {
  Eigen::Matrix3d homography;
  homography << 0.95, -0.25, 45, 0.2, 0.9, -5, 2e-4, -1e-4, 1;
  return homography;
}

cv::Mat Warped(const cv::Mat& image, const Eigen::Matrix3d& homography) {
  Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
  shift.topRightCorner<2, 1>().setConstant(0.5);
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> of_indices =
      shift.inverse() * homography * shift;
  const cv::Mat matrix(3, 3, CV_64F, const_cast<double*>(of_indices.data()));
  cv::Mat warped;
  cv::warpPerspective(image, warped, matrix, image.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
  return warped;
}

double ReprojectionError(const Correspondences& matches, std::size_t i,
                         const Eigen::Matrix3d& homography) {
  const Eigen::Vector2d expected = (homography * matches.reference[i].homogeneous()).hnormalized();
  return (matches.query[i] - expected).norm();
}

TEST(SiftMatcher, FindsAKnownHomography) {
  const cv::Mat reference = Texture(320, 240);
  const Correspondences matches =
      SiftMatcher().Match(reference, Warped(reference, QueryFromReference()));
  ASSERT_GT(matches.size(), 100u);
  int near = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    near += ReprojectionError(matches, i, QueryFromReference()) < 2;
    EXPECT_TRUE(matches.scores[i] >= 0.2 && matches.scores[i] <= 1);
  }
  EXPECT_GE(near, 0.9 * static_cast<double>(matches.size()));
}

TEST(SiftMatcher, SwappingTheImagesSwapsThePoints) {
  const cv::Mat reference = Texture(160, 120), query = Warped(reference, QueryFromReference());
  const Correspondences matches = SiftMatcher().Match(reference, query);
  const Correspondences swapped = SiftMatcher().Match(query, reference);
  ASSERT_GT(matches.size(), 10u);
  ASSERT_EQ(swapped.size(), matches.size());
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const auto same = [&](const Eigen::Vector2d& point) { return point == matches.query[i]; };
    const auto found = std::ranges::find_if(swapped.reference, same);
    ASSERT_NE(found, swapped.reference.end());
    EXPECT_EQ(swapped.query[found - swapped.reference.begin()], matches.reference[i]);
  }
}

/// A half turn maps x to width - x where pixel centres are at integer + 0.5, and nowhere else.
TEST(SiftMatcher, PixelCentresAreAtIntegerPlusHalf) {
  const cv::Mat reference = Texture(160, 120);
  cv::Mat query;
  cv::rotate(reference, query, cv::ROTATE_180);
  const Correspondences matches = SiftMatcher().Match(reference, query);
  ASSERT_GT(matches.size(), 50u);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < matches.size(); ++i) sum += matches.reference[i] + matches.query[i];
  const Eigen::Vector2d mean = sum / static_cast<double>(matches.size());
  EXPECT_NEAR(mean.x(), 160, 0.1);
  EXPECT_NEAR(mean.y(), 120, 0.1);
}

TEST(SiftMatcher, ASmallerRatioKeepsTheSurest) {
  const cv::Mat reference = Texture(160, 120), query = Warped(reference, QueryFromReference());
  const Correspondences all = SiftMatcher({.max_ratio = 1}).Match(reference, query);
  const Correspondences sure = SiftMatcher({.max_ratio = 0.5}).Match(reference, query);
  const auto above_half =
      std::ranges::count_if(all.scores, [](double score) { return score > 0.5; });
  EXPECT_EQ(sure.size(), static_cast<std::size_t>(above_half));
  EXPECT_LT(sure.size(), all.size());
  EXPECT_GT(sure.size(), 0u);
}

TEST(SiftMatcher, GivesNothingForImagesWithoutContent) {
  const cv::Mat texture = Texture(160, 120);
  std::vector<cv::Mat> contentless = {{},
                                      cv::Mat(100, 80, CV_8UC3, cv::Scalar::all(128)),
                                      texture({0, 0, 160, 3}),
                                      texture({0, 0, 2, 120})};
  for (int side = 1; side < 16; ++side) contentless.push_back(texture({0, 0, side, side}));
  for (const cv::Mat& image : contentless) {
    EXPECT_EQ(SiftMatcher().Match(image, texture).size(), 0u) << image.size();
    EXPECT_EQ(SiftMatcher().Match(texture, image).size(), 0u) << image.size();
    EXPECT_EQ(SiftMatcher().Match(image, image).size(), 0u) << image.size();
  }
}

TEST(SiftMatcher, RefusesOtherImagesAndOptions) {
  const cv::Mat rgb = Texture(32, 32);
  EXPECT_THROW(SiftMatcher().Match(rgb, cv::Mat(32, 32, CV_8UC1)), Error);
  EXPECT_THROW(SiftMatcher({.max_ratio = 0}), InvalidOption);
  EXPECT_THROW(SiftMatcher({.max_features = 0}), InvalidOption);
}

}  // namespace
}  // namespace antipode
