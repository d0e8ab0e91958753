#pragma once

#include <map>
#include <string>

#include <torch/torch.h>

#include "antipode/nn/efficientnet_lite.h"
#include "antipode/weights/safetensors.h"

namespace antipode {

struct ObjectEncoderConfig {
  int image_size = 128;    ///< side of the square input, pixels; a multiple of 32
  int max_degree = 8;      ///< L: codes are band-limited functions on the sphere
  int channels = 32;       ///< C: how many such functions a code has
  int width = 192;         ///< of the transformer
  int layers = 4;
  int heads = 6;
  int feed_forward = 576;
  int spatial_bases = 16;  ///< K: learned maps from the token grid to the sphere
  void Check() const;

  std::map<std::string, std::string> ToMetadata() const;
  /// @throws BadFile naming `file` and the missing or malformed entry
  static ObjectEncoderConfig FromMetadata(const std::map<std::string, std::string>& metadata,
                                          const std::string& file);
};

/// What the encoder leaves out at random while it trains; nothing in evaluation mode.
struct EncoderDropout {
  double branches = 0;  ///< share of residual branches, image by image (stochastic depth, Huang et al. 2016)
  double tokens = 0;    ///< share of tokens whose features are replaced by their position alone
};

/// Pre-norm transformer layer (Vaswani et al. 2017; Xiong et al. 2020), GELU.
class TransformerLayerImpl : public torch::nn::Module {
 public:
  TransformerLayerImpl(int width, int heads, int feed_forward);
  /// @param branch_dropout share of residual branches left out, image by image
  torch::Tensor forward(torch::Tensor tokens, double branch_dropout = 0);  // [N, T, width] -> the same

 private:
  int heads_;
  torch::nn::LayerNorm norm1{nullptr}, norm2{nullptr};
  torch::nn::Linear to_qkv{nullptr}, to_out{nullptr}, expand{nullptr}, contract{nullptr};
};
TORCH_MODULE(TransformerLayer);

/// From one object-centric image to an equivariant code: C functions on the unit sphere in camera axes,
/// as real spherical-harmonic coefficients of degree 0..L. If the object turns by R in front of the
/// camera, an ideal code becomes D(R) F (see geometry/wigner.h). Idea: Esteves et al., ICML 2019.
///
/// Backbone features of strides 8, 16 and 32 are joined into one token for every 16 x 16 pixels; after the
/// transformer, token p contributes sum_k S[k, p, lm] (A_k x_p)[c] to coefficient (c, lm). The maps S
/// start as harmonics of the front and the back of a sphere seen orthographically.
/// Degree l is scaled by softplus(gain_l), and the whole code to norm exp(log_norm).
class ObjectEncoderImpl : public torch::nn::Module {
 public:
  explicit ObjectEncoderImpl(const ObjectEncoderConfig& config);

  /// @param images [N, 3, S, S], RGB in [0, 1], white background
  /// @return [N, C, (L + 1)^2], float32
  torch::Tensor forward(const torch::Tensor& images);

  /// The two halves of `forward`, for training the head alone.
  FeaturePyramid Features(const torch::Tensor& images) { return backbone->forward(images); }
  torch::Tensor CodeFromFeatures(const FeaturePyramid& features);

  void SetDropout(const EncoderDropout& dropout) { dropout_ = dropout; }

  const ObjectEncoderConfig& config() const { return config_; }
  EfficientNetLite0 backbone{nullptr};

 private:
  torch::Tensor Tokens(const FeaturePyramid& features);

  ObjectEncoderConfig config_;
  EncoderDropout dropout_;
  torch::nn::LayerNorm norm8{nullptr}, norm16{nullptr}, norm32{nullptr}, norm_out{nullptr};
  torch::nn::Linear project8{nullptr}, project16{nullptr}, project32{nullptr}, to_values{nullptr};
  torch::nn::ModuleList layers;
  torch::Tensor position, spatial_basis, degree_gain, log_norm;
};
TORCH_MODULE(ObjectEncoder);

}  // namespace antipode
