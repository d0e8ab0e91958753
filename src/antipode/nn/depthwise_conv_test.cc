#include "antipode/nn/depthwise_conv.h"

#include <gtest/gtest.h>

namespace antipode {
namespace {

struct Case {
  int channels, size, kernel, stride;
  torch::Dtype dtype;
  double tolerance;
};

class DepthwiseConvTest : public testing::TestWithParam<Case> {};

TEST_P(DepthwiseConvTest, HasTheLibrarysValueAndGradient) {
  const Case& c = GetParam();
  torch::manual_seed(7);
  const auto make = [&] {
    return torch::randn({3, c.channels, c.size, c.size + 2})
        .to(c.dtype)
        .contiguous(torch::MemoryFormat::ChannelsLast);
  };
  const auto values = make();
  const auto weight_values = torch::randn({c.channels, 1, c.kernel, c.kernel});
  const auto bias_values = torch::randn({c.channels});
  const int padding = c.kernel / 2;

  const auto leaf = [](const torch::Tensor& t) { return t.detach().clone().requires_grad_(); };
  const auto x = leaf(values), w = leaf(weight_values), b = leaf(bias_values);
  const auto y = DepthwiseConv2d(x, w, b, c.stride, padding);
  const auto gradient = torch::randn_like(y);
  y.backward(gradient);

  const auto x_ref = leaf(values.to(torch::kDouble)), w_ref = leaf(weight_values.to(c.dtype).to(torch::kDouble)),
             b_ref = leaf(bias_values.to(c.dtype).to(torch::kDouble));
  const auto y_ref = at::conv2d(x_ref, w_ref, b_ref, c.stride, padding, 1, c.channels);
  y_ref.backward(gradient.to(torch::kDouble));

  const auto relative = [](const torch::Tensor& a, const torch::Tensor& reference) {
    return ((a.to(torch::kDouble) - reference).norm() / reference.norm()).item<double>();
  };
  EXPECT_LT(relative(y, y_ref), c.tolerance);
  EXPECT_LT(relative(x.grad(), x_ref.grad()), c.tolerance);
  EXPECT_LT(relative(w.grad(), w_ref.grad()), c.tolerance);
  EXPECT_LT(relative(b.grad(), b_ref.grad()), c.tolerance);
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, DepthwiseConvTest,
    testing::Values(Case{32, 9, 3, 1, torch::kFloat, 1e-6}, Case{48, 8, 3, 2, torch::kFloat, 1e-6},
                    Case{32, 7, 5, 1, torch::kFloat, 1e-6}, Case{16, 10, 5, 2, torch::kFloat, 1e-6},
                    Case{20, 8, 3, 1, torch::kFloat, 1e-6},
                    Case{32, 9, 3, 1, torch::kBFloat16, 1e-2},
                    Case{64, 8, 5, 2, torch::kBFloat16, 1e-2}));

}  // namespace
}  // namespace antipode
