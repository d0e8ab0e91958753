#include "antipode/matching/loftr_transformer.h"

namespace antipode {
namespace {

constexpr int kHeads = 8;
constexpr double kDenominatorGuard = 1e-6;

torch::nn::Linear MakeLinear(int in_size, int out_size) {
  return torch::nn::Linear(torch::nn::LinearOptions(in_size, out_size).bias(false));
}

torch::nn::LayerNorm MakeNorm(int channels) {
  return torch::nn::LayerNorm(torch::nn::LayerNormOptions({channels}));
}

torch::Tensor Positive(const torch::Tensor& x) { return torch::elu(x).add_(1); }

torch::Tensor SplitHeads(const torch::Tensor& x) {
  return x.unflatten(-1, {kHeads, x.size(-1) / kHeads});
}

}  // namespace

torch::Tensor LinearAttention(const torch::Tensor& queries, const torch::Tensor& keys,
                              const torch::Tensor& values) {
  const auto q = Positive(queries).transpose(1, 2);  // [N, heads, L, D]
  const auto k = Positive(keys).transpose(1, 2);     // [N, heads, S, D]
  const auto summary =
      torch::matmul(k.transpose(-1, -2), values.transpose(1, 2));  // [N, heads, D, D]
  const auto total = k.sum(-2).unsqueeze(-1);                      // [N, heads, D, 1]
  auto message = torch::matmul(q, summary);
  return message.div_(torch::matmul(q, total).add_(kDenominatorGuard)).transpose(1, 2);
}

LoftrLayerImpl::LoftrLayerImpl(int channels)
    : query_(MakeLinear(channels, channels)),
      key_(MakeLinear(channels, channels)),
      value_(MakeLinear(channels, channels)),
      merge_(MakeLinear(channels, channels)),
      expand_(MakeLinear(2 * channels, 2 * channels)),
      project_(MakeLinear(2 * channels, channels)),
      message_norm_(MakeNorm(channels)),
      output_norm_(MakeNorm(channels)) {
  register_module("q_proj", query_);
  register_module("k_proj", key_);
  register_module("v_proj", value_);
  register_module("merge", merge_);
  register_module("mlp", torch::nn::ModuleList(expand_, torch::nn::ReLU(), project_));
  register_module("norm1", message_norm_);
  register_module("norm2", output_norm_);
}

torch::Tensor LoftrLayerImpl::forward(const torch::Tensor& x, const torch::Tensor& source) {
  const auto gathered =
      LinearAttention(SplitHeads(query_(x)), SplitHeads(key_(source)), SplitHeads(value_(source)))
          .flatten(-2);
  const auto message = message_norm_(merge_(gathered));
  return output_norm_(project_(expand_(torch::cat({x, message}, -1)).relu_())).add_(x);
}

LoftrTransformerImpl::LoftrTransformerImpl(int channels, int layers) {
  for (int i = 0; i < layers; ++i) layers_->push_back(LoftrLayer(channels));
  register_module("layers", layers_);
}

LoftrTokens LoftrTransformerImpl::forward(LoftrTokens tokens) {
  for (std::size_t i = 0; i < layers_->size(); ++i) {
    LoftrLayerImpl& layer = *layers_[i]->as<LoftrLayer>();
    const bool is_self_attention = i % 2 == 0;
    tokens.first = layer.forward(tokens.first, is_self_attention ? tokens.first : tokens.second);
    tokens.second = layer.forward(tokens.second, is_self_attention ? tokens.second : tokens.first);
  }
  return tokens;
}

}  // namespace antipode
