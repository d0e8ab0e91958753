#include "antipode/matching/loftr_matcher.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kSide = 96;

cv::Mat Texture(const std::string& name, int width, int height) {
  const auto noise = (SyntheticUniform(name, {height, width, 3}) + 1).mul(127.5).to(torch::kUInt8);
  cv::Mat texture;
  cv::GaussianBlur(cv::Mat(height, width, CV_8UC3, noise.data_ptr()), texture, {}, 1.5);
  return texture;
}

/// Without training the confidences are low, but not their order.
LoftrMatcher EagerMatcher() {
  Loftr network;
  FillSynthetic(*network);
  return LoftrMatcher(network, {.max_side = kSide, .network = {.min_confidence = 0}});
}

cv::Mat Enlarged(const cv::Mat& image, int factor) {
  cv::Mat enlarged;
  cv::resize(image, enlarged, {}, factor, factor, cv::INTER_NEAREST);
  return enlarged;
}

TEST(LoftrMatcher, PointsScaleWithTheImage) {
  const LoftrMatcher matcher = EagerMatcher();
  const cv::Mat reference = Texture("reference", kSide, kSide), query = Texture("query", kSide, 72);
  const Correspondences matches = matcher.Match(reference, query);
  const Correspondences enlarged = matcher.Match(Enlarged(reference, 2), Enlarged(query, 3));
  ASSERT_GT(matches.size(), 3u);
  ASSERT_EQ(enlarged.size(), matches.size());
  for (std::size_t i = 0; i < matches.size(); ++i) {
    EXPECT_LT((enlarged.reference[i] - 2 * matches.reference[i]).norm(), 1e-9);
    EXPECT_LT((enlarged.query[i] - 3 * matches.query[i]).norm(), 1e-9);
    EXPECT_EQ(enlarged.scores[i], matches.scores[i]);
  }
}

TEST(LoftrMatcher, PointsAreCellCornersPlusHalfAPixelWithinTheImages) {
  const Correspondences matches =
      EagerMatcher().Match(Texture("reference", kSide, 64), Texture("query", 56, kSide));
  ASSERT_GT(matches.size(), 3u);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Eigen::Vector2d cell = (matches.reference[i].array() - 0.5) / 8;
    EXPECT_EQ(cell, cell.array().round().matrix());
    EXPECT_TRUE(matches.query[i].x() > 0 && matches.query[i].x() < 56);
    EXPECT_TRUE(matches.query[i].y() > 0 && matches.query[i].y() < kSide);
    EXPECT_TRUE(matches.scores[i] > 0 && matches.scores[i] <= 1);
  }
}

TEST(LoftrMatcher, SmallImagesAreEnlargedAtMostTwofold) {
  const LoftrMatcher matcher = EagerMatcher();
  const Correspondences matches =
      matcher.Match(Texture("reference", 40, 30), Texture("query", 37, 41));
  ASSERT_GT(matches.size(), 0u);
  for (const Eigen::Vector2d& point : matches.reference) {
    const double cell = (2 * point.x() - 0.5) / 8;
    EXPECT_NEAR(cell, std::round(cell), 1e-9);
  }
}

TEST(LoftrMatcher, GivesNothingForImagesWithoutContent) {
  const LoftrMatcher matcher = EagerMatcher();
  const cv::Mat texture = Texture("reference", kSide, kSide);
  const cv::Mat white(kSide, kSide, CV_8UC3, cv::Scalar::all(255));
  cv::Mat nearly_white = white.clone();
  nearly_white.at<cv::Vec3b>(50, 50) = {250, 250, 250};
  const std::vector<cv::Mat> contentless = {{},
                                            white,
                                            nearly_white,
                                            Texture("a", 1, 1),
                                            Texture("b", 17, 17),
                                            Texture("c", 200, 5),
                                            Texture("d", 3, 400)};
  ASSERT_GT(matcher.Match(texture, texture).size(), 0u);
  for (const cv::Mat& image : contentless) {
    EXPECT_EQ(matcher.Match(image, texture).size(), 0u) << image.size();
    EXPECT_EQ(matcher.Match(texture, image).size(), 0u) << image.size();
    EXPECT_EQ(matcher.Match(image, image).size(), 0u) << image.size();
  }
}

TEST(LoftrMatcher, RefusesOtherImagesAndOptions) {
  const LoftrMatcher matcher = EagerMatcher();
  const cv::Mat rgb = Texture("reference", 32, 32);
  EXPECT_THROW(matcher.Match(rgb, cv::Mat(32, 32, CV_8UC1)), Error);
  EXPECT_THROW(matcher.Match(cv::Mat(32, 32, CV_32FC3), rgb), Error);
  EXPECT_THROW(LoftrMatcher(Loftr(), {.max_side = 7}), InvalidOption);
  EXPECT_THROW(LoftrMatcher(Loftr(), {.network = {.border = -1}}), InvalidOption);
  EXPECT_THROW(LoftrMatcher::Load("no-such-model"), Error);
}

}  // namespace
}  // namespace antipode
