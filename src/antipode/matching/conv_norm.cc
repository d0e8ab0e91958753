#include "antipode/matching/conv_norm.h"

namespace antipode {

void ConvNorm::Prepare() {
  const torch::NoGradGuard no_gradient;
  auto scale = torch::rsqrt(norm->running_var + norm->options.eps());
  if (norm->options.affine()) scale = scale * norm->weight;
  weight = (conv->weight * scale.view({-1, 1, 1, 1})).contiguous(torch::MemoryFormat::ChannelsLast);
  bias = -norm->running_mean * scale;
  if (norm->options.affine()) bias = bias + norm->bias;
}

torch::Tensor ConvNorm::operator()(const torch::Tensor& x) const {
  return at::conv2d(x, weight, bias, conv->options.stride(), weight.size(2) / 2);
}

}  // namespace antipode
