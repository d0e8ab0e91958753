#include "antipode/matching/aliked_matcher.h"

#include <gtest/gtest.h>

#include "antipode/matching/test_images.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

TensorFile SyntheticAlikedWeights(const std::string& seed) {
  AlikedNetwork network;
  FillSynthetic(*network, seed);
  return WeightsOf(*network);
}

/// Sure of every point, and with sharp similarities: it matches points with equal features.
LightGlue DecidedLightGlue() {
  LightGlue network(LightGlueConfig::ForAliked());
  FillSynthetic(*network);
  const torch::NoGradGuard no_gradient;
  for (auto& item : network->named_parameters()) {
    if (item.key().ends_with("matchability.bias")) item.value().fill_(20);
    if (item.key().ends_with("final_proj.weight")) item.value().mul_(10);
  }
  return network;
}

TensorFile SyntheticModel() {
  return AlikedLightGlueWeights(SyntheticAlikedWeights("a."), SyntheticAlikedWeights("b."),
                                WeightsOf(*DecidedLightGlue()), "synthetic");
}

class AlikedModel : public testing::Test {
 protected:
  AlikedModel() {
    SaveModel(folder_.path(), "aliked", SyntheticModel(), "for tests", "none", "# card");
  }

  AlikedLightGlueMatcher Load(AlikedVariant variant) const {
    return AlikedLightGlueMatcher::Load(folder_.path() / "aliked", variant, {.top_k = 200});
  }

  TemporaryFolder folder_;
};

TEST_F(AlikedModel, MatchesAnImageWithItself) {
  const cv::Mat picture = BlockImage("input.a", 160, 120);
  const Correspondences found = Load(AlikedVariant::kN16).Match(picture, picture);
  EXPECT_GT(found.size(), 4u);
  ASSERT_EQ(found.reference.size(), found.size());
  ASSERT_EQ(found.query.size(), found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found.reference[i], found.query[i]);
    EXPECT_TRUE(
        cv::Rect2d(0, 0, 160, 120).contains({found.reference[i].x(), found.reference[i].y()}));
    EXPECT_GT(found.scores[i], 0.1);
    EXPECT_LE(found.scores[i], 1);
  }
}

TEST_F(AlikedModel, TheVariantsHaveTheirOwnWeights) {
  const cv::Mat picture = BlockImage("input.a", 160, 120);
  EXPECT_NE(Load(AlikedVariant::kN16).Match(picture, picture).reference,
            Load(AlikedVariant::kN16Rotated).Match(picture, picture).reference);
}

TEST_F(AlikedModel, WhereThereIsNothingToSeeNothingMatches) {
  const AlikedLightGlueMatcher matcher = Load(AlikedVariant::kN16);
  const cv::Mat picture = BlockImage("input.a", 160, 120),
                plain(100, 100, CV_8UC3, cv::Scalar(255, 255, 255));
  EXPECT_EQ(matcher.Match(picture, plain).size(), 0u);
  EXPECT_EQ(matcher.Match(plain, picture).size(), 0u);
  EXPECT_EQ(matcher.Match(plain, cv::Mat(0, 0, CV_8UC3)).size(), 0u);
}

TEST(AlikedLightGlueWeights, KeepFeaturesInFullPrecision) {
  const TensorFile model = SyntheticModel();
  const TensorFile rotated = WithoutPrefix(model, "aliked-n16rot."),
                   expected = SyntheticAlikedWeights("b.");
  ASSERT_EQ(rotated.tensors.size(), expected.tensors.size());
  for (const auto& [name, tensor] : expected.tensors)
    EXPECT_EQ(rotated.tensors.at(name).data, tensor.data) << name;
  for (const auto& [name, tensor] : WithoutPrefix(model, "matcher.").tensors)
    EXPECT_EQ(tensor.dtype, Dtype::kF16) << name;
}

TEST(AlikedLightGlueWeights, RefuseWhatDoesNotBelong) {
  const TensorFile features = SyntheticAlikedWeights("a.");
  EXPECT_THROW(AlikedLightGlueWeights(features, features, features, "a.whl"), BadFile);
}

}  // namespace
}  // namespace antipode
