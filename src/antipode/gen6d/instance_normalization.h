#pragma once

#include <torch/torch.h>

namespace antipode {

/// Instance norm without parameters, over everything but batch and channel, epsilon 1e-5: [B, C, ...].
inline torch::Tensor NormalizeInstances(const torch::Tensor& x) {
  return at::instance_norm(x, {}, {}, {}, {}, /*use_input_stats=*/true, 0, 1e-5, false);
}

/// The same as a place in a sequence of layers.
struct InstanceNormalizationImpl : torch::nn::Module {
  torch::Tensor forward(const torch::Tensor& x) { return NormalizeInstances(x); }
};
TORCH_MODULE(InstanceNormalization);

}  // namespace antipode
