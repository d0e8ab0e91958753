#pragma once

#include <cstdint>
#include <vector>

#include <torch/torch.h>

#include "antipode/nn/layers.h"
#include "antipode/nn/observation.h"

namespace antipode {

/// The shape of CLIP's vision transformer (Radford et al., ICML 2021); the default is ViT-L/14.
struct ClipConfig {
  std::int64_t width = 1024;
  std::int64_t layers = 24;
  std::int64_t heads = 16;
  std::int64_t patch = 14;
  std::int64_t output_width = 768;
  std::int64_t image_size = 224;
};

/// Bicubic (A = -0.75, corners aligned, no antialiasing) to size x size, then CLIP's mean and deviation of each colour.
/// @param image [B, 3, H, W], RGB in -1..1
torch::Tensor ClipInput(const torch::Tensor& image, std::int64_t size);

class ClipBlockImpl;

/// `visual.*` of the published checkpoints.
class ClipImageTowerImpl : public torch::nn::Module {
 public:
  explicit ClipImageTowerImpl(const ClipConfig& config = {});

  /// @param image [B, 3, H, W], RGB in -1..1, any size
  /// @return [B, output_width], not normalised to length 1
  torch::Tensor forward(const torch::Tensor& image, const Observation& observation = {}) const;

 private:
  ClipConfig config_;
  torch::Tensor class_embedding_, positional_embedding_, proj_;
  Convolution conv1_{nullptr};
  LayerNormalization ln_pre_{nullptr}, ln_post_{nullptr};
  std::vector<std::shared_ptr<ClipBlockImpl>> blocks_;
};
TORCH_MODULE(ClipImageTower);

}  // namespace antipode
