#include "antipode/training/matching_pairs.h"

#include <gtest/gtest.h>

#include "antipode/matching/xfeat_matcher.h"
#include "antipode/nn/parts.h"
#include "antipode/render/test_meshes.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

constexpr float kBoxHalf = 0.5f;
constexpr double kHalfAPixel = 4e-3;  // of depth, on a face seen obliquely

/// Every face has its own blocks of random colours.
Mesh TexturedBox() {
  Mesh mesh = MakeBox({kBoxHalf, kBoxHalf, kBoxHalf});
  std::mt19937_64 random(4);
  for (Material& material : mesh.materials) {
    material.texture.create(24, 24, CV_8UC3);
    material.texture.forEach<cv::Vec3b>([](cv::Vec3b& texel, const int*) { texel = {255, 255, 255}; });
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 24; ++x)
        for (int c = 0; c < 3; ++c) material.texture.at<cv::Vec3b>(y, x)[c] = static_cast<std::uint8_t>(UniformIndex(random, 256));
  }
  return mesh;
}

XFeat ShippedXFeat() { return XFeat(WithoutPrefix(LoadModel(kXFeatLighterGlueModel), kXFeatPrefix), kXFeatLighterGlueModel, {.top_k = 300}); }

std::vector<SurfacePair> PairsOfBox(const MatchingPairOptions& options, std::uint64_t seed = 1) {
  std::mt19937_64 random(seed);
  return RenderMatchingPairs(ShippedXFeat(), TexturedBox(), options, random);
}

SurfaceFeatures FeaturesAt(const std::vector<std::array<float, 3>>& points) {
  const auto count = static_cast<std::int64_t>(points.size());
  SurfaceFeatures features{LocalFeatures::None(4, {100, 100}), torch::empty({count, 3})};
  for (std::int64_t i = 0; i < count; ++i)
    for (int k = 0; k < 3; ++k) features.points[i][k] = points[i][k];
  return features;
}

TEST(MatchSurfaces, TellsMatchedFromLonely) {
  const float nowhere = std::nanf("");
  const SurfaceFeatures a = FeaturesAt({{0, 0, 0}, {0.5f, 0, 0}, {0, 0.02f, 0}, {nowhere, nowhere, nowhere}});
  const SurfaceFeatures b = FeaturesAt({{0.9f, 0, 0}, {0.5f, 0.01f, 0}, {0.001f, 0, 0}, {nowhere, nowhere, nowhere}});
  const TrueMatches truth = MatchSurfaces(a, b);
  EXPECT_TRUE(torch::equal(truth.reference, torch::tensor({0, 1}, torch::kLong)));
  EXPECT_TRUE(torch::equal(truth.query, torch::tensor({2, 1}, torch::kLong)));
  EXPECT_TRUE(torch::equal(truth.reference_is_lonely, torch::tensor({false, false, false, true})));
  EXPECT_TRUE(torch::equal(truth.query_is_lonely, torch::tensor({true, false, false, true})));
}

TEST(RenderMatchingPairs, PointsAreOnTheSurface) {
  const std::vector<SurfacePair> pairs = PairsOfBox({.views = 5, .crop_pairs = 2, .halfway_pairs = 2});
  ASSERT_FALSE(pairs.empty());
  for (const SurfacePair& pair : pairs) {
    ASSERT_GT(pair.reference.features.size(), 50);
    const torch::Tensor largest = pair.reference.points.abs().amax(1);  // a box: its largest coordinate is the half side
    const torch::Tensor known = largest.isnan().logical_not();
    EXPECT_GT(known.sum().item<std::int64_t>(), 50);
    EXPECT_LT((largest.masked_select(known) - kBoxHalf).abs().max().item<double>(), kHalfAPixel);
  }
}

TEST(RenderMatchingPairs, ViewsFromNearbyShareManyPoints) {
  std::int64_t most = 0;
  for (const SurfacePair& pair : PairsOfBox({.views = 6, .crop_pairs = 4, .halfway_pairs = 4}, 2))
    most = std::max(most, MatchSurfaces(pair.reference, pair.query).reference.size(0));
  EXPECT_GT(most, 60);
}

TEST(RenderMatchingPairs, SameSeedGivesTheSamePairs) {
  const MatchingPairOptions options{.views = 3, .crop_pairs = 1, .halfway_pairs = 1};
  const auto first = PairsOfBox(options, 5), again = PairsOfBox(options, 5);
  ASSERT_EQ(first.size(), again.size());
  for (std::size_t i = 0; i < first.size(); ++i)
    EXPECT_TRUE(torch::equal(first[i].query.features.keypoints, again[i].query.features.keypoints));
}

TEST(RenderMatchingPairs, RefusesImpossibleOptions) {
  EXPECT_THROW(PairsOfBox({.views = 1}), InvalidOption);
  EXPECT_THROW(PairsOfBox({.crop_pairs = 0, .halfway_pairs = 0}), InvalidOption);
}

}  // namespace
}  // namespace antipode
