#pragma once

#include <cstdint>
#include <vector>

#include <torch/torch.h>

#include "antipode/nn/layers.h"
#include "antipode/nn/observation.h"

namespace antipode {

/// The shape of the autoencoder of latent diffusion (Rombach et al., CVPR 2022); each level after the first halves
/// the resolution. The default is Zero123's, of factor 8.
struct AutoencoderConfig {
  std::int64_t image_channels = 3;
  std::int64_t latent_channels = 4;
  std::int64_t base_width = 128;
  std::vector<std::int64_t> multipliers{1, 2, 4, 4};
  std::int64_t residual_blocks = 2;  ///< of each level of the encoder; one more in the decoder
};

/// What the noise latents are divided by before decoding.
inline constexpr double kLatentScale = 0.18215;

/// x + conv2(silu(norm2(conv1(silu(norm1(x)))))), x by `nin_shortcut` where the width changes.
class AutoencoderResidualBlockImpl : public torch::nn::Module {
 public:
  AutoencoderResidualBlockImpl(std::int64_t inputs, std::int64_t outputs);
  torch::Tensor forward(const torch::Tensor& x) const;

 private:
  GroupNormalization norm1_, norm2_;
  Convolution conv1_, conv2_, shortcut_{nullptr};
};
TORCH_MODULE(AutoencoderResidualBlock);

/// One head over all pixels; `q`, `k`, `v` and `proj_out` are 1 x 1 convolutions.
class PixelAttentionImpl : public torch::nn::Module {
 public:
  explicit PixelAttentionImpl(std::int64_t width);
  torch::Tensor forward(const torch::Tensor& x) const;

 private:
  GroupNormalization norm_;
  Convolution q_, k_, v_, proj_out_;
};
TORCH_MODULE(PixelAttention);

/// Halves the resolution: a row and a column of zeros at the bottom and on the right only, then `conv` of stride 2.
class AutoencoderDownsamplingImpl : public torch::nn::Module {
 public:
  explicit AutoencoderDownsamplingImpl(std::int64_t width);
  torch::Tensor forward(const torch::Tensor& x) const;

 private:
  Convolution conv_;
};
TORCH_MODULE(AutoencoderDownsampling);

class AutoencoderHalfImpl;

/// Images in -1..1 to latents and back. Members are named as in the published checkpoints (without
/// `first_stage_model.`).
class AutoencoderImpl : public torch::nn::Module {
 public:
  explicit AutoencoderImpl(const AutoencoderConfig& config = {});

  /// Mean and log-variance of the latent, [B, 2 latent_channels, H / f, W / f].
  torch::Tensor Moments(const torch::Tensor& image, const Observation& observation = {}) const;
  /// The mean alone, not scaled by `kLatentScale`.
  torch::Tensor Encode(const torch::Tensor& image) const;
  /// @param latent not scaled: a sample must be divided by `kLatentScale` first
  torch::Tensor Decode(const torch::Tensor& latent, const Observation& observation = {}) const;

 private:
  std::int64_t latent_channels_;
  std::shared_ptr<AutoencoderHalfImpl> encoder_, decoder_;
  Convolution quant_conv_, post_quant_conv_;
};
TORCH_MODULE(Autoencoder);

}  // namespace antipode
