#pragma once

#include <torch/torch.h>

namespace antipode {

/// Whether `WinogradConvolution` can and should take this 3 x 3 convolution of stride 1 and padding 1: float32 on the
/// CPU, channels last, both widths multiples of 16, no gradient wanted, and so many pixels that it is faster.
/// @param x [B, C, H, W]
/// @param weight [K, C, 3, 3]
bool WinogradIsFaster(const torch::Tensor& x, const torch::Tensor& weight);

/// The convolution with a quarter of the multiplications (Lavin and Gray, "Fast Algorithms for Convolutional Neural
/// Networks", CVPR 2016, F(4 x 4, 3 x 3)): y = A^T [sum_c (G g G^T) * (B^T d B)] A for every tile of 4 x 4 pixels. Exact
/// but for rounding, whose error is about twice that of the direct sum. Weights are transformed anew in every
/// call: kept, they would be four times as large as they are.
///
/// @param x [B, C, H, W], channels last
/// @param weight [K, C, 3, 3], channels last
/// @param bias [K] or undefined
/// @return [B, K, H, W], channels last
torch::Tensor WinogradConvolution(const torch::Tensor& x, const torch::Tensor& weight, const torch::Tensor& bias);

}  // namespace antipode
