#pragma once

#include <utility>
#include <vector>

#include <torch/torch.h>

namespace antipode {

/// Attention without the softmax, linear in the number of tokens (Katharopoulos et al.,
/// "Transformers are RNNs", ICML 2020): with phi(z) = elu(z) + 1,
///   message_l = phi(q_l) (sum_s phi(k_s) v_s^T) / (phi(q_l) . sum_s phi(k_s) + 1e-6).
/// @param queries [N, L, heads, D]
/// @param keys, values [N, S, heads, D]
/// @return [N, L, heads, D]
torch::Tensor LinearAttention(const torch::Tensor& queries, const torch::Tensor& keys,
                              const torch::Tensor& values);

/// x + norm2(mlp([x, norm1(merge(message))])), the message being what linear attention with 8 heads
/// gathers for each token of x from the tokens of `source`.
class LoftrLayerImpl : public torch::nn::Module {
 public:
  explicit LoftrLayerImpl(int channels);

  /// @param x [N, L, C]
  /// @param source [N, S, C]
  torch::Tensor forward(const torch::Tensor& x, const torch::Tensor& source);

 private:
  torch::nn::Linear query_, key_, value_, merge_, expand_, project_;
  torch::nn::LayerNorm message_norm_, output_norm_;
};
TORCH_MODULE(LoftrLayer);

/// The tokens of two images.
struct LoftrTokens {
  torch::Tensor first;   ///< [N, L, C]
  torch::Tensor second;  ///< [N, S, C]
};

/// Layers that by turns let each image attend to itself, and each to the other: in the latter the
/// first image comes first, and the second attends to the result. So the two images are not
/// exchangeable.
class LoftrTransformerImpl : public torch::nn::Module {
 public:
  LoftrTransformerImpl(int channels, int layers);
  LoftrTokens forward(LoftrTokens tokens);

 private:
  torch::nn::ModuleList layers_;
};
TORCH_MODULE(LoftrTransformer);

}  // namespace antipode
