#pragma once

#include <cstdint>

#include <torch/torch.h>

namespace antipode {

/// Layers of large networks. Unlike LibTorch's, they leave their parameters uninitialised: a billion random
/// numbers that a checkpoint overwrites take longer to draw than the checkpoint to read. Parameters are called
/// `weight` and `bias`.

enum class Bias { kWith, kWithout };

/// y = x W^T + b, W [outputs, inputs].
class DenseImpl : public torch::nn::Module {
 public:
  DenseImpl(std::int64_t inputs, std::int64_t outputs, Bias bias = Bias::kWith);
  torch::Tensor forward(const torch::Tensor& x) const;

  torch::Tensor weight, bias;
};
TORCH_MODULE(Dense);

struct ConvolutionOptions {
  std::int64_t kernel = 3, stride = 1, padding = 1;
  Bias bias = Bias::kWith;
};

/// Square kernel, zero padding, W [outputs, inputs, kernel, kernel]. See winograd_convolution.h for the fast path.
class ConvolutionImpl : public torch::nn::Module {
 public:
  ConvolutionImpl(std::int64_t inputs, std::int64_t outputs, const ConvolutionOptions& options = {});
  torch::Tensor forward(const torch::Tensor& x) const;  // [B, inputs, H, W] -> [B, outputs, H', W']

  torch::Tensor weight, bias;

 private:
  ConvolutionOptions options_;
};
TORCH_MODULE(Convolution);

/// A 1 x 1 convolution with bias.
Convolution PointwiseConvolution(std::int64_t inputs, std::int64_t outputs);

/// Group normalisation with 32 groups and an affine per channel, computed in float32.
class GroupNormalizationImpl : public torch::nn::Module {
 public:
  GroupNormalizationImpl(std::int64_t channels, double epsilon);
  torch::Tensor forward(const torch::Tensor& x) const;  // [B, channels, ...]

  torch::Tensor weight, bias;

 private:
  double epsilon_;
};
TORCH_MODULE(GroupNormalization);

/// Over the last axis, with affine and epsilon 1e-5.
class LayerNormalizationImpl : public torch::nn::Module {
 public:
  explicit LayerNormalizationImpl(std::int64_t width);
  torch::Tensor forward(const torch::Tensor& x) const;

  torch::Tensor weight, bias;
};
TORCH_MODULE(LayerNormalization);

/// Doubles the resolution: nearest neighbour, then `conv`.
class UpsamplingImpl : public torch::nn::Module {
 public:
  explicit UpsamplingImpl(std::int64_t width);
  torch::Tensor forward(const torch::Tensor& x) const;

 private:
  Convolution conv_;
};
TORCH_MODULE(Upsampling);

/// x sigmoid(1.702 x).
torch::Tensor QuickGelu(const torch::Tensor& x);

/// softmax(q k^T / sqrt(d)) v for each head: q [B, N, heads d], k and v [B, M, heads d] -> [B, N, heads d]; channels
/// are head-major. Fused where no gradient is wanted, written out where one is (the fused one's backward pass is slow).
torch::Tensor MultiHeadAttention(const torch::Tensor& q, const torch::Tensor& k, const torch::Tensor& v, std::int64_t heads);

/// Stores convolution weights pixel by pixel ("channels last"): processors convolve faster that way, and the outputs
/// are stored so, too.
void UseChannelsLast(torch::nn::Module& module);

/// Fills dense layers, convolutions and norms of `module` for training from scratch: weights uniform in
/// +-sqrt(1 / fan_in), norms 1, biases 0.
void InitializeForTraining(torch::nn::Module& module, std::uint64_t seed);

}  // namespace antipode
