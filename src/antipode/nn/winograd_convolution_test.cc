#include "antipode/nn/winograd_convolution.h"

#include <gtest/gtest.h>

namespace antipode {
namespace {

struct Case {
  int images, inputs, outputs, height, width;
};

torch::Tensor ChannelsLast(const torch::Tensor& x) { return x.contiguous(at::MemoryFormat::ChannelsLast); }

class WinogradConvolutionTest : public testing::TestWithParam<Case> {};

TEST_P(WinogradConvolutionTest, IsTheConvolution) {
  const Case& c = GetParam();
  const torch::InferenceMode inference;
  torch::manual_seed(3);
  const auto x = ChannelsLast(torch::randn({c.images, c.inputs, c.height, c.width}));
  const auto weight = ChannelsLast(torch::randn({c.outputs, c.inputs, 3, 3}));
  for (const auto& bias : {torch::randn({c.outputs}), torch::Tensor()}) {
    const auto expected = at::conv2d(x.to(torch::kDouble), weight.to(torch::kDouble),
                                     bias.defined() ? bias.to(torch::kDouble) : bias, 1, 1);
    const auto y = WinogradConvolution(x, weight, bias);
    ASSERT_EQ(y.sizes(), expected.sizes());
    EXPECT_TRUE(y.is_contiguous(at::MemoryFormat::ChannelsLast));
    EXPECT_LT(((y - expected).norm() / expected.norm()).item<double>(), 2e-6);
  }
}

// Sides that are no multiples of the tile, more tiles than are handled at once, and more outputs.
INSTANTIATE_TEST_SUITE_P(Shapes, WinogradConvolutionTest,
                         testing::Values(Case{1, 16, 16, 4, 4}, Case{2, 32, 16, 7, 9}, Case{3, 16, 48, 1, 2}, Case{5, 32, 32, 33, 30},
                                         Case{2, 48, 144, 12, 16}, Case{1, 16, 64, 68, 64}));

TEST(WinogradConvolution, IsLeftToOthersWhereItIsNotFasterOrNotPossible) {
  const torch::InferenceMode inference;
  const auto weight = ChannelsLast(torch::randn({16, 16, 3, 3}));
  const auto x = ChannelsLast(torch::randn({4, 16, 16, 16}));
  EXPECT_TRUE(WinogradIsFaster(x, weight));
  EXPECT_FALSE(WinogradIsFaster(x.slice(0, 0, 1), weight)) << "few pixels";
  EXPECT_FALSE(WinogradIsFaster(x.to(torch::kDouble), weight));
  EXPECT_FALSE(WinogradIsFaster(x.contiguous(), weight)) << "channels first";
  EXPECT_FALSE(WinogradIsFaster(x, ChannelsLast(torch::randn({4, 16, 3, 3})))) << "outputs that fill no pack";
}

TEST(WinogradConvolution, IsNotUsedWhereGradientsAreWanted) {
  const auto weight = ChannelsLast(torch::randn({16, 16, 3, 3}));
  EXPECT_FALSE(WinogradIsFaster(ChannelsLast(torch::randn({4, 16, 16, 16})), weight));
}

}  // namespace
}  // namespace antipode
