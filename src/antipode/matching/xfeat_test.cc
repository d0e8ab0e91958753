#include "antipode/matching/xfeat.h"

#include <gtest/gtest.h>

#include "antipode/matching/test_images.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

/// Every pixel is nearly as likely to the synthetic network: just above 1/65.
constexpr XFeatOptions kGoldenOptions{.top_k = 60, .detection_threshold = 0.016};

XFeat SyntheticXFeat(const XFeatOptions& options) {
  XFeatNetwork network;
  FillSynthetic(*network);
  return XFeat(WeightsOf(*network), "synthetic", options);
}

TEST(XFeatNetwork, AgreesWithThePythonPackage) {
  const torch::NoGradGuard no_gradient;
  XFeatNetwork network;
  FillSynthetic(*network);
  const auto grey = ((SyntheticUniform("input.grey", {1, 1, 64, 96}) + 1) / 2).to(torch::kFloat);
  const auto pairs = SyntheticUniform("input.pairs", {5, 128}).to(torch::kFloat);
  network->Prepare();
  const XFeatMaps maps = network->forward(grey);
  ExpectNear(maps.descriptors, Golden("xfeat_network", "descriptors"));
  ExpectNear(maps.keypoint_logits, Golden("xfeat_network", "keypoint_logits"));
  ExpectNear(maps.reliability, Golden("xfeat_network", "reliability"));
  const auto logits = network->RefinementLogits(pairs.narrow(1, 0, 64), pairs.narrow(1, 64, 64));
  ExpectNear(logits, Golden("xfeat_network", "refinement"));
}

/// The package scales pixel indices, this library pixel centres.
torch::Tensor CentresOf(const torch::Tensor& package_keypoints, double x_scale, double y_scale) {
  return package_keypoints + torch::tensor({x_scale, y_scale}, torch::kFloat) / 2;
}

TEST(XFeat, DetectsWhatThePythonPackageDetects) {
  const LocalFeatures features =
      SyntheticXFeat(kGoldenOptions).Detect(BlockImage("input.picture", 101, 70));
  ASSERT_EQ(features.size(), 60);
  ExpectNear(features.keypoints,
             CentresOf(Golden("xfeat_features", "keypoints"), 101.0 / 96, 70.0 / 64));
  ExpectNear(features.scores, Golden("xfeat_features", "scores"));
  ExpectNear(features.descriptors, Golden("xfeat_features", "descriptors"));
}

TEST(XFeat, DetectsEveryKeypointThatThePythonPackageDetects) {
  XFeatOptions options = kGoldenOptions;
  options.top_k = 100000;
  const LocalFeatures features =
      SyntheticXFeat(options).Detect(BlockImage("input.picture", 101, 70));
  ExpectNear(features.keypoints,
             CentresOf(Golden("xfeat_features", "every_keypoint"), 101.0 / 96, 70.0 / 64));
}

TEST(XFeat, DetectsTheCellsThatThePythonPackageDetects) {
  XFeatOptions options = kGoldenOptions;
  options.top_k = 50;
  const SemiDenseFeatures dense =
      SyntheticXFeat(options).DetectSemiDense(BlockImage("input.picture", 101, 70));
  ExpectNear(dense.features.keypoints,
             CentresOf(Golden("xfeat_features", "dense_keypoints"), 1, 1));
  ExpectNear(dense.features.descriptors, Golden("xfeat_features", "dense_descriptors"));
  ExpectNear(dense.scales, Golden("xfeat_features", "dense_scales"));
}

TEST(XFeat, KeypointsOfAShrunkImageAreInItsOwnPixels) {
  const cv::Mat small = BlockImage("input.picture", 96, 64);
  cv::Mat large;
  cv::resize(small, large, {}, 4, 4, cv::INTER_NEAREST);
  XFeatOptions options = kGoldenOptions;
  options.max_side = 96;
  const XFeat xfeat = SyntheticXFeat(options);
  ExpectNear(xfeat.Detect(large).keypoints, 4 * xfeat.Detect(small).keypoints);
  const SemiDenseFeatures of_large = xfeat.DetectSemiDense(large),
                          of_small = xfeat.DetectSemiDense(small);
  ExpectNear(of_large.features.keypoints, 4 * of_small.features.keypoints);
  ExpectNear(of_large.scales, 4 * of_small.scales);
}

TEST(XFeat, FindsNothingWhereThereIsNothing) {
  const XFeat xfeat = SyntheticXFeat({});
  const cv::Mat plain(64, 64, CV_8UC3, cv::Scalar(90, 90, 90)),
      thin(31, 200, CV_8UC3, cv::Scalar(1, 2, 3));
  EXPECT_EQ(xfeat.Detect(plain).size(), 0);
  EXPECT_EQ(xfeat.Detect(thin).size(), 0);
  EXPECT_EQ(xfeat.Detect(cv::Mat(0, 0, CV_8UC3)).size(), 0);
  EXPECT_EQ(xfeat.DetectSemiDense(thin).features.size(), 0);
}

TEST(XFeat, AcceptsAnyShape) {
  const XFeat xfeat = SyntheticXFeat(kGoldenOptions);
  for (const cv::Size size :
       {cv::Size(32, 32), cv::Size(33, 900), cv::Size(3000, 40), cv::Size(647, 63)}) {
    const LocalFeatures features = xfeat.Detect(BlockImage("input.any", size.width, size.height));
    EXPECT_TRUE((features.keypoints >= 0).all().item<bool>()) << size;
    EXPECT_LE(features.keypoints.select(1, 0).max().item<double>(), size.width) << size;
    EXPECT_LE(features.keypoints.select(1, 1).max().item<double>(), size.height) << size;
    EXPECT_GT(
        xfeat.DetectSemiDense(BlockImage("input.any", size.width, size.height)).features.size(), 0)
        << size;
  }
}

TEST(XFeat, RefusesImpossibleInput) {
  EXPECT_THROW(SyntheticXFeat({.top_k = 0}), InvalidOption);
  EXPECT_THROW(SyntheticXFeat({.detection_threshold = 1}), InvalidOption);
  EXPECT_THROW(SyntheticXFeat({.max_side = 31}), InvalidOption);
  EXPECT_THROW(SyntheticXFeat({}).Detect(cv::Mat(64, 64, CV_8UC1)), Error);
  EXPECT_THROW(XFeat(TensorFile{}, "empty.pt"), BadFile);
}

}  // namespace
}  // namespace antipode
