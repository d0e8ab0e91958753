#include "antipode/nn/layers.h"

#include <cmath>

#include <ATen/CPUGeneratorImpl.h>

#include "antipode/nn/winograd_convolution.h"

namespace antipode {
namespace {

constexpr std::int64_t kGroups = 32;
constexpr double kLayerNormEpsilon = 1e-5;

torch::Tensor MaybeBias(torch::nn::Module& module, std::int64_t outputs, Bias bias) {
  if (bias == Bias::kWithout) return module.register_parameter("bias", {}, false);
  return module.register_parameter("bias", torch::empty({outputs}));
}

}  // namespace

DenseImpl::DenseImpl(std::int64_t inputs, std::int64_t outputs, Bias bias_wanted)
    : weight(register_parameter("weight", torch::empty({outputs, inputs}))),
      bias(MaybeBias(*this, outputs, bias_wanted)) {}

torch::Tensor DenseImpl::forward(const torch::Tensor& x) const { return at::linear(x, weight, bias); }

ConvolutionImpl::ConvolutionImpl(std::int64_t inputs, std::int64_t outputs, const ConvolutionOptions& options)
    : weight(register_parameter("weight", torch::empty({outputs, inputs, options.kernel, options.kernel}))),
      bias(MaybeBias(*this, outputs, options.bias)),
      options_(options) {}

torch::Tensor ConvolutionImpl::forward(const torch::Tensor& x) const {
  const bool is_plain = options_.kernel == 3 && options_.stride == 1 && options_.padding == 1;
  if (is_plain && WinogradIsFaster(x, weight)) return WinogradConvolution(x, weight, bias);
  return at::conv2d(x, weight, bias, options_.stride, options_.padding);
}

Convolution PointwiseConvolution(std::int64_t inputs, std::int64_t outputs) {
  return Convolution(inputs, outputs, ConvolutionOptions{.kernel = 1, .padding = 0});
}

GroupNormalizationImpl::GroupNormalizationImpl(std::int64_t channels, double epsilon)
    : weight(register_parameter("weight", torch::empty({channels}))),
      bias(register_parameter("bias", torch::empty({channels}))),
      epsilon_(epsilon) {}

torch::Tensor GroupNormalizationImpl::forward(const torch::Tensor& x) const {
  if (x.scalar_type() == torch::kFloat || x.is_cpu()) return at::group_norm(x, kGroups, weight, bias, epsilon_);
  return at::group_norm(x.to(torch::kFloat), kGroups, weight.to(torch::kFloat), bias.to(torch::kFloat), epsilon_)
      .to(x.scalar_type());
}

LayerNormalizationImpl::LayerNormalizationImpl(std::int64_t width)
    : weight(register_parameter("weight", torch::empty({width}))),
      bias(register_parameter("bias", torch::empty({width}))) {}

torch::Tensor LayerNormalizationImpl::forward(const torch::Tensor& x) const {
  return at::layer_norm(x, {weight.size(0)}, weight, bias, kLayerNormEpsilon);
}

UpsamplingImpl::UpsamplingImpl(std::int64_t width) : conv_(register_module("conv", Convolution(width, width))) {}

torch::Tensor UpsamplingImpl::forward(const torch::Tensor& x) const {
  return conv_->forward(at::upsample_nearest2d(x, {2 * x.size(2), 2 * x.size(3)}));
}

torch::Tensor QuickGelu(const torch::Tensor& x) { return x * at::sigmoid(1.702 * x); }

torch::Tensor MultiHeadAttention(const torch::Tensor& q, const torch::Tensor& k, const torch::Tensor& v, std::int64_t heads) {
  const auto split = [&](const torch::Tensor& x) {  // -> [B, heads, N, d]
    return x.view({x.size(0), x.size(1), heads, x.size(2) / heads}).transpose(1, 2);
  };
  const auto queries = split(q), keys = split(k), values = split(v);
  torch::Tensor merged;
  if (torch::GradMode::is_enabled() && q.requires_grad()) {
    const double scale = 1 / std::sqrt(static_cast<double>(queries.size(3)));
    merged = at::matmul(at::softmax(at::matmul(queries * scale, keys.transpose(2, 3)), -1), values);
  } else {
    merged = at::scaled_dot_product_attention(queries, keys, values);
  }
  return merged.transpose(1, 2).reshape(q.sizes());
}

void UseChannelsLast(torch::nn::Module& module) {
  const torch::NoGradGuard no_gradient;
  for (auto& item : module.named_parameters())
    if (item.value().dim() == 4) item.value().set_data(item.value().contiguous(at::MemoryFormat::ChannelsLast));
}

void InitializeForTraining(torch::nn::Module& module, std::uint64_t seed) {
  const torch::NoGradGuard no_gradient;
  auto generator = at::make_generator<at::CPUGeneratorImpl>(seed);
  for (auto& item : module.named_parameters()) {
    torch::Tensor& parameter = item.value();
    if (parameter.dim() >= 2) {
      const double bound = std::sqrt(static_cast<double>(parameter.size(0)) / static_cast<double>(parameter.numel()));
      parameter.uniform_(-bound, bound, generator);
    } else {
      parameter.fill_(item.key().ends_with("weight") ? 1 : 0);
    }
  }
}

}  // namespace antipode
