#include "antipode/matching/deformable_conv.h"

#include <algorithm>

#include "antipode/matching/conv_norm.h"
#include "antipode/matching/multi_scale_features.h"

namespace antipode {
namespace {

constexpr int kTaps = 9;

/// Where the taps lie without offsets: [H, W, 9, 2], column and row.
torch::Tensor TapPositions(std::int64_t height, std::int64_t width,
                           const torch::TensorOptions& options) {
  const auto steps = torch::arange(-1, 2, options);
  const auto columns = torch::arange(width, options).view({1, -1, 1, 1}) + steps.view({1, 1, 1, 3});
  const auto rows = torch::arange(height, options).view({-1, 1, 1, 1}) + steps.view({1, 1, 3, 1});
  const auto all = [&](const torch::Tensor& x) {
    return x.expand({height, width, 3, 3}).flatten(2);
  };
  return torch::stack({all(columns), all(rows)}, 3);
}

}  // namespace

void DeformableConvNorm::Prepare() {
  ConvNorm folded{conv, norm, {}, {}};
  folded.Prepare();
  weight = folded.weight.permute({2, 3, 1, 0}).reshape({-1, folded.weight.size(0)}).contiguous();
  bias = folded.bias;
}

torch::Tensor DeformableConvNorm::operator()(const torch::Tensor& x) const {
  const std::int64_t height = x.size(2), width = x.size(3);
  const double limit = static_cast<double>(std::max(height, width)) / 4;
  const auto moved = at::conv2d(x, offsets->weight, offsets->bias, 1, 1).clamp_(-limit, limit);
  const auto row_then_column = moved[0].permute({1, 2, 0}).reshape({height, width, kTaps, 2});
  const auto positions = TapPositions(height, width, x.options()) + row_then_column.flip(3);
  const auto samples = SampleBilinear(x[0].permute({1, 2, 0}), positions.view({-1, 2}));
  const auto result = at::addmm(bias, samples.view({height * width, -1}), weight);
  return result.view({1, height, width, -1}).permute({0, 3, 1, 2});
}

}  // namespace antipode
