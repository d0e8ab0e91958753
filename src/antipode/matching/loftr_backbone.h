#pragma once

#include <string>
#include <vector>

#include <torch/torch.h>

namespace antipode {

/// Convolution followed by batch normalisation with the statistics of the checkpoint, evaluated as
/// one convolution.
struct NormalizedConv {
  torch::nn::Conv2d conv{nullptr};
  torch::nn::BatchNorm2d norm{nullptr};

  torch::Tensor operator()(const torch::Tensor& x) const;
};

/// relu(norm(conv3x3(relu(norm(conv3x3(x, stride))))) + shortcut), the shortcut being x itself or,
/// where the block has a stride, norm(conv1x1(x, stride)).
class LoftrResidualBlockImpl : public torch::nn::Module {
 public:
  LoftrResidualBlockImpl(int in_channels, int out_channels, int stride);
  torch::Tensor forward(const torch::Tensor& x) const;

 private:
  NormalizedConv first_, second_, shortcut_;
};
TORCH_MODULE(LoftrResidualBlock);

/// Feature maps of one image.
struct LoftrFeatures {
  torch::Tensor coarse;  ///< [N, 256, H/8, W/8]
  torch::Tensor fine;    ///< [N, 128, H/2, W/2]
};

/// The convolutional part of LoFTR: residual blocks down to stride 8, then a feature pyramid back
/// up to stride 2. The element (row, column) of a map with stride s belongs to the pixel (s row, s
/// column).
class LoftrBackboneImpl : public torch::nn::Module {
 public:
  LoftrBackboneImpl();

  /// @param image [N, 1, H, W], grey in [0, 1], H and W multiples of 8
  LoftrFeatures forward(const torch::Tensor& image) const;

 private:
  /// conv3x3(leaky_relu(norm(conv3x3(x)))): what smooths a sum of two levels.
  struct Smoothing {
    NormalizedConv first;
    torch::nn::Conv2d second{nullptr};

    torch::Tensor operator()(const torch::Tensor& x) const;
  };
  using Blocks = std::vector<LoftrResidualBlock>;

  Blocks AddBlocks(const std::string& name, int in_channels, int out_channels, int stride);
  Smoothing AddSmoothing(const std::string& name, int in_channels, int out_channels);

  NormalizedConv stem_;
  Blocks stride2_, stride4_, stride8_;
  torch::nn::Conv2d lateral2_{nullptr}, lateral4_{nullptr}, lateral8_{nullptr};
  Smoothing smoothing2_, smoothing4_;
};
TORCH_MODULE(LoftrBackbone);

}  // namespace antipode
