#pragma once

#include <torch/torch.h>

namespace antipode {

/// Deformable 3 x 3 convolution with batch normalisation (Dai et al., "Deformable Convolutional
/// Networks", ICCV 2017): a first convolution says for each pixel by how much each of the nine taps
/// of a second one is moved. Offsets are limited to a quarter of the longer side of the map;
/// outside the map is zero.
struct DeformableConvNorm {
  torch::nn::Conv2d offsets{nullptr};  ///< C -> 18: row and column for each tap
  torch::nn::Conv2d conv{nullptr};     ///< C -> C', without bias
  torch::nn::BatchNorm2d norm{nullptr};

  /// Derives from the parameters what is evaluated; to be called again when they or their device
  /// change.
  void Prepare();
  torch::Tensor operator()(
      const torch::Tensor& x) const;  ///< [1, C, H, W] -> [1, C', H, W], after `Prepare`

  torch::Tensor weight, bias;  ///< [9 C, C'] and [C'] as `Prepare` left them
};

}  // namespace antipode
