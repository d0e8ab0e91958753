#include "antipode/matching/multi_scale_features.h"

#include <gtest/gtest.h>

#include "antipode/matching/test_images.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

/// Positions in and around a map of this size; some are pixel centres.
torch::Tensor Positions(int width, int height) {
  const auto anywhere = (SyntheticUniform("input.positions", {200, 2}) + 1) / 2;
  const auto scaled = anywhere * torch::tensor({width + 4, height + 4}) - 2;
  const auto corners =
      torch::tensor({{0, 0}, {width - 1, height - 1}, {width - 1, 0}, {-1, 3}, {2, height}});
  return torch::cat({scaled, scaled.round(), corners.to(torch::kDouble)}).to(torch::kFloat);
}

/// The same by the library, for a map [1, C, H, W].
torch::Tensor Sampled(const torch::Tensor& map, const torch::Tensor& positions) {
  const auto last = torch::tensor({map.size(3) - 1, map.size(2) - 1});
  const auto grid = (positions / last * 2 - 1).view({1, -1, 1, 2});
  return at::grid_sampler(map, grid, 0, 0, true)[0].squeeze(2).t();
}

torch::Tensor Map(const std::string& name, int channels, int height, int width) {
  return SyntheticUniform("input." + name, {1, channels, height, width}).to(torch::kFloat);
}

torch::Tensor ChannelsLast(const torch::Tensor& map) { return map[0].permute({1, 2, 0}); }

TEST(SampleBilinear, IsTheLibrarysGridSampling) {
  const auto map = Map("map", 5, 17, 23);
  const auto positions = Positions(23, 17);
  ExpectNear(SampleBilinear(ChannelsLast(map), positions), Sampled(map, positions));
}

TEST(MultiScaleFeatures, IsTheNormalizedMapOfAllLevels) {
  const auto fine = Map("fine", 32, 32, 64), coarse = Map("coarse", 32, 4, 8),
             coarsest = Map("coarsest", 32, 1, 2);
  const auto upsampled = [](const torch::Tensor& map) {
    return at::upsample_bilinear2d(map, {32, 64}, true);
  };
  const auto dense = torch::cat({fine, upsampled(coarse), upsampled(coarsest)}, 1);
  const cv::Rect visible(5, 3, 50, 27);
  const auto seen = torch::nn::functional::normalize(dense).slice(2, 3, 30).slice(3, 5, 55);
  const MultiScaleFeatures features(
      {ChannelsLast(fine), ChannelsLast(coarse), ChannelsLast(coarsest)}, visible);
  const auto positions = Positions(visible.width, visible.height);
  ExpectNear(features.SampleBilinear(positions), Sampled(seen, positions));
}

TEST(MultiScaleFeatures, RefusesTooManyLevels) {
  const auto level = ChannelsLast(Map("fine", 32, 4, 4));
  EXPECT_THROW(MultiScaleFeatures({level, level, level, level, level}, {0, 0, 4, 4}), Error);
  EXPECT_THROW(MultiScaleFeatures({}, {0, 0, 4, 4}), Error);
}

}  // namespace
}  // namespace antipode
