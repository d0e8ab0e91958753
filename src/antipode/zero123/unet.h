#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <torch/torch.h>

#include "antipode/nn/layers.h"
#include "antipode/nn/observation.h"

namespace antipode {

/// The shape of a conditional diffusion UNet (Rombach et al., "High-Resolution Image Synthesis with Latent Diffusion
/// Models", CVPR 2022). The default is Zero123's: noise latent and image latent in, noise out.
struct UnetConfig {
  std::int64_t input_channels = 8;
  std::int64_t output_channels = 4;
  std::int64_t base_width = 320;
  std::vector<std::int64_t> multipliers{1, 2, 4, 4};        ///< width of level L: base_width multipliers[L]
  std::int64_t residual_blocks = 2;                         ///< of each level on the way down; one more on the way up
  std::vector<std::int64_t> attention_factors{1, 2, 4};     ///< 2^L of the levels with transformers
  std::int64_t heads = 8;
  std::int64_t transformer_depth = 1;
  std::int64_t context_width = 768;
  void Check() const;
};

/// [cos(t f_0), .., cos(t f_{h-1}), sin(t f_0), .., sin(t f_{h-1})], f_k = exp(-ln(10000) k / h), h = width / 2.
/// @param timesteps [B]
/// @return [B, width], float32
torch::Tensor TimestepEmbedding(const torch::Tensor& timesteps, std::int64_t width);

/// h = conv(silu(norm(x))) + linear(silu(embedding)); y = conv(silu(norm(h))) + shortcut(x).
class UnetResidualBlockImpl : public torch::nn::Module {
 public:
  UnetResidualBlockImpl(std::int64_t inputs, std::int64_t outputs, std::int64_t embedding_width);
  /// @param embedding [B or 1, embedding_width]
  torch::Tensor forward(const torch::Tensor& x, const torch::Tensor& embedding, const Observation& observation) const;

 private:
  GroupNormalization first_norm_, second_norm_;
  Convolution first_, second_, shortcut_{nullptr};
  Dense embedding_;
};
TORCH_MODULE(UnetResidualBlock);

/// `to_q`, `to_k`, `to_v` without bias, `to_out.0` with.
class CrossAttentionImpl : public torch::nn::Module {
 public:
  CrossAttentionImpl(std::int64_t width, std::int64_t context_width, std::int64_t heads);
  torch::Tensor forward(const torch::Tensor& x, const torch::Tensor& context) const;
  /// What attending to a single token gives at every pixel: the softmax over one key is 1.
  /// @param token [B, 1, context_width]
  /// @return [B, 1, width]
  torch::Tensor OfSingleToken(const torch::Tensor& token) const;

 private:
  Dense to_q_, to_k_, to_v_, to_out_;
  std::int64_t heads_;
};
TORCH_MODULE(CrossAttention);

/// a gelu(g), (a, g) = x W^T + b, with the exact GELU.
class GatedGeluImpl : public torch::nn::Module {
 public:
  GatedGeluImpl(std::int64_t width, std::int64_t outputs);
  torch::Tensor forward(const torch::Tensor& x) const;

 private:
  Dense proj_;
};
TORCH_MODULE(GatedGelu);

/// Halves the resolution: `op`, a convolution of stride 2, zeros on all sides.
class UnetDownsamplingImpl : public torch::nn::Module {
 public:
  explicit UnetDownsamplingImpl(std::int64_t width);
  torch::Tensor forward(const torch::Tensor& x) const;

 private:
  Convolution op_;
};
TORCH_MODULE(UnetDownsampling);

class UnetTransformerImpl;

/// What the transformers attend to, prepared once for all steps.
struct UnetContext {
  torch::Tensor tokens;                 ///< [B, T, context_width]
  std::vector<torch::Tensor> constant;  ///< [B, 1, C] of every transformer block in order; only for T = 1
};

enum class ContextPath {
  kConstantForOneToken,  ///< exact and faster
  kGeneral,
};

/// Some output of the deep levels, kept from one step to the next (Ma et al., "DeepCache", CVPR 2024).
struct UnetCache {
  torch::Tensor deep;            ///< input of the last `shallow_blocks` output blocks
  std::int64_t shallow_blocks = 1;
};

class UnetBlockImpl;

/// The denoiser. Members are named as in the published checkpoints (without `model.diffusion_model.`). Inputs may have another
/// precision than the weights, which decide how it is computed; outputs have that of `x`.
class UnetImpl : public torch::nn::Module {
 public:
  explicit UnetImpl(const UnetConfig& config = {});

  /// @param tokens [B, T, context_width]
  UnetContext Prepare(const torch::Tensor& tokens, ContextPath path = ContextPath::kConstantForOneToken) const;

  /// @param x [B, input_channels, H, W], H and W multiples of 2^(levels - 1)
  /// @param timesteps [B], or [1] if it is the same for all
  /// @return [B, output_channels, H, W]
  torch::Tensor forward(const torch::Tensor& x, const torch::Tensor& timesteps, const UnetContext& context,
                        const Observation& observation = {}) const;

  /// The same, and fills `cache`.
  torch::Tensor ForwardAndKeep(const torch::Tensor& x, const torch::Tensor& timesteps, const UnetContext& context,
                               UnetCache& cache) const;
  /// Computes the shallow blocks alone, with the deep output of an earlier step. Approximate.
  torch::Tensor ForwardShallow(const torch::Tensor& x, const torch::Tensor& timesteps, const UnetContext& context,
                               const UnetCache& cache) const;

  const UnetConfig& config() const { return config_; }

 private:
  torch::Tensor Embed(const torch::Tensor& timesteps, const Observation& observation) const;
  torch::Tensor Predict(const torch::Tensor& h) const;
  torch::Dtype Type() const;

  UnetConfig config_;
  Dense first_embedding_{nullptr}, second_embedding_{nullptr};
  std::vector<std::shared_ptr<UnetBlockImpl>> input_blocks_, output_blocks_;
  std::shared_ptr<UnetBlockImpl> middle_block_;
  GroupNormalization out_norm_{nullptr};
  Convolution out_{nullptr};
  std::vector<std::shared_ptr<UnetTransformerImpl>> transformers_;
};
TORCH_MODULE(Unet);

/// One step of many: the deep levels are computed if `step` is a multiple of `full_step_every` or the cache is empty, else taken
/// from the cache.
torch::Tensor PredictWithCache(const UnetImpl& unet, const torch::Tensor& x, const torch::Tensor& timesteps, const UnetContext& context,
                               UnetCache& cache, int step, int full_step_every);

}  // namespace antipode
