#pragma once

#include <vector>

#include <torch/torch.h>

namespace antipode {

/// The convolutions of VGG-11 with batch normalisation (Simonyan and Zisserman, ICLR 2015), statistics fixed.
/// Parameters are named as in the published checkpoints: `features.N`.
class Vgg11Impl : public torch::nn::Module {
 public:
  Vgg11Impl();

  /// @param images [B, 3, H, W], RGB in [0, 1]; normalised inside with ImageNet's mean and standard deviation
  /// @return the outputs of the five stages: 64 channels at stride 1, 128 at 2, 256 at 4, 512 at 8 and 512 at 16,
  ///   the last without its ReLU
  std::vector<torch::Tensor> forward(const torch::Tensor& images);

 private:
  torch::nn::Sequential features_;
};
TORCH_MODULE(Vgg11);

}  // namespace antipode
