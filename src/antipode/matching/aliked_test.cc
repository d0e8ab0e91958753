#include "antipode/matching/aliked.h"

#include <gtest/gtest.h>

#include "antipode/matching/test_images.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

Aliked SyntheticAliked(const AlikedOptions& options) {
  AlikedNetwork network;
  FillSynthetic(*network);
  return Aliked(WeightsOf(*network), "synthetic", options);
}

/// Where the picture of 101 x 70 pixels lies in the next larger multiples of 32.
const cv::Rect kInside(13, 13, 101, 70);

AlikedNetwork SyntheticNetwork() {
  AlikedNetwork network;
  FillSynthetic(*network);
  network->Prepare();
  return network;
}

AlikedMaps MapsOfPicture(const AlikedNetwork& network) {
  cv::Mat padded;
  cv::copyMakeBorder(BlockImage("input.picture", 101, 70), padded, 13, 13, 13, 14,
                     cv::BORDER_REPLICATE);
  const auto pixels = torch::from_blob(padded.data, {1, 96, 128, 3}, torch::kUInt8);
  return network->forward(pixels.permute({0, 3, 1, 2}).to(torch::kFloat) / 255);
}

TEST(AlikedNetwork, ScoresAsThePythonPackage) {
  const torch::NoGradGuard no_gradient;
  const AlikedMaps maps = MapsOfPicture(SyntheticNetwork());
  ExpectNear(maps.score.slice(0, 13, 83).slice(1, 13, 114), Golden("aliked_features", "score"));
}

TEST(AlikedNetwork, DescribesTheBorderAsThePythonPackage) {
  const torch::NoGradGuard no_gradient;
  const AlikedNetwork network = SyntheticNetwork();
  const MultiScaleFeatures features(MapsOfPicture(network).levels, kInside);
  const auto keypoints = torch::tensor(
      {{0.2f, 0.3f}, {99.7f, 68.6f}, {0.4f, 68.7f}, {98.2f, 1.2f}, {50.5f, 67.9f}, {99.2f, 30.5f}});
  ExpectNear(network->Describe(features, keypoints, kInside.size()),
             Golden("aliked_features", "at_border"));
}

TEST(Aliked, DetectsWhatThePythonPackageDetects) {
  const LocalFeatures features =
      SyntheticAliked({.top_k = 40}).Detect(BlockImage("input.picture", 101, 70));
  ASSERT_EQ(features.size(), 40);
  ExpectNear(features.keypoints, Golden("aliked_features", "keypoints") + 0.5);
  ExpectNear(features.descriptors, Golden("aliked_features", "descriptors"));
}

TEST(Aliked, KeypointsOfAShrunkImageAreInItsOwnPixels) {
  const cv::Mat small = BlockImage("input.picture", 96, 64);
  cv::Mat large;
  cv::resize(small, large, {}, 4, 4, cv::INTER_NEAREST);
  const Aliked aliked = SyntheticAliked({.top_k = 40, .max_side = 96});
  ExpectNear(aliked.Detect(large).keypoints, 4 * aliked.Detect(small).keypoints);
}

TEST(Aliked, FindsNothingWhereThereIsNothing) {
  const Aliked aliked = SyntheticAliked({});
  const cv::Mat plain(64, 64, CV_8UC3, cv::Scalar(90, 90, 90)),
      thin(31, 200, CV_8UC3, cv::Scalar(1, 2, 3));
  EXPECT_EQ(aliked.Detect(plain).size(), 0);
  EXPECT_EQ(aliked.Detect(thin).size(), 0);
  EXPECT_EQ(aliked.Detect(cv::Mat(0, 0, CV_8UC3)).size(), 0);
}

TEST(Aliked, AcceptsAnyShape) {
  const Aliked aliked = SyntheticAliked({});
  for (const cv::Size size :
       {cv::Size(32, 32), cv::Size(33, 900), cv::Size(3000, 40), cv::Size(647, 63)}) {
    const LocalFeatures features = aliked.Detect(BlockImage("input.any", size.width, size.height));
    ASSERT_GT(features.size(), 0) << size;
    EXPECT_TRUE((features.keypoints >= 0).all().item<bool>()) << size;
    EXPECT_LE(features.keypoints.select(1, 0).max().item<double>(), size.width) << size;
    EXPECT_LE(features.keypoints.select(1, 1).max().item<double>(), size.height) << size;
    EXPECT_TRUE(features.descriptors.isfinite().all().item<bool>()) << size;
  }
}

TEST(Aliked, RefusesImpossibleInput) {
  EXPECT_THROW(SyntheticAliked({.top_k = 0}), InvalidOption);
  EXPECT_THROW(SyntheticAliked({.detection_threshold = 0}), InvalidOption);
  EXPECT_THROW(SyntheticAliked({.max_side = 31}), InvalidOption);
  EXPECT_THROW(SyntheticAliked({}).Detect(cv::Mat(64, 64, CV_8UC1)), Error);
  EXPECT_THROW(Aliked(TensorFile{}, "empty.pth"), BadFile);
}

}  // namespace
}  // namespace antipode
