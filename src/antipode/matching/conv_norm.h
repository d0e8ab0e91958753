#pragma once

#include <torch/torch.h>

namespace antipode {

/// Convolution without bias and batch normalisation with fixed statistics, evaluated as one
/// convolution: y = conv(x, w s) + (beta - mean s), s = gamma / sqrt(variance + 1e-5). Zeros around
/// the image keep its size at stride 1.
struct ConvNorm {
  torch::nn::Conv2d conv{nullptr};
  torch::nn::BatchNorm2d norm{nullptr};

  /// Derives from the parameters what is evaluated; to be called again when they or their device
  /// change.
  void Prepare();
  torch::Tensor operator()(const torch::Tensor& x) const;  ///< after `Prepare`

  torch::Tensor weight, bias;  ///< as `Prepare` left them
};

}  // namespace antipode
