#pragma once

#include <torch/torch.h>

namespace antipode {

/// Depthwise convolution, y[n,c] = x[n,c] * weight[c] + bias[c], with symmetric zero padding.
///
/// @param input  [N, C, H, W]
/// @param weight [C, 1, K, K]
/// @param bias   [C]
///
/// The result is that of `torch::conv2d(..., groups = C)`. On the CPU, for channels-last float32 or
/// bfloat16 input with C a multiple of 16 and K = 3 or 5, the gradient is computed by kernels of our own:
/// the library's take five to fifty times as long as its forward pass.
torch::Tensor DepthwiseConv2d(const torch::Tensor& input, const torch::Tensor& weight,
                              const torch::Tensor& bias, int stride, int padding);

}  // namespace antipode
