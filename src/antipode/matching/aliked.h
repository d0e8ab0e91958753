#pragma once

#include <string>
#include <vector>

#include <torch/torch.h>
#include <opencv2/core.hpp>

#include "antipode/matching/conv_norm.h"
#include "antipode/matching/deformable_conv.h"
#include "antipode/matching/local_features.h"
#include "antipode/matching/multi_scale_features.h"
#include "antipode/weights/safetensors.h"

namespace antipode {

/// What the network says about an image of H x W pixels.
struct AlikedMaps {
  torch::Tensor score;  ///< [H, W], 0..1: how good a keypoint the pixel is
  /// [H/s, W/s, 32] each, s = 1, 2, 8, 32; see `MultiScaleFeatures`
  std::vector<torch::Tensor> levels;
};

/// The networks n16 and n16rot of ALIKED (Zhao et al., "ALIKED: A Lighter Keypoint and Descriptor
/// Extraction Network via Deformable Transformation", IEEE Transactions on Instrumentation and
/// Measurement 2023). Parameters are named as in the published checkpoints.
class AlikedNetworkImpl : public torch::nn::Module {
 public:
  AlikedNetworkImpl();

  /// Derives from the parameters what the other methods use; to be called again when they or their
  /// device change.
  void Prepare();

  /// @param image [1, 3, H, W], RGB in 0..1, H and W multiples of 32
  AlikedMaps forward(const torch::Tensor& image) const;

  /// Descriptors [N, 128] of length 1 from 16 places around each keypoint, which depend on what is
  /// there.
  /// @param keypoints [N, 2], column and row in the map; pixel centres at integers
  torch::Tensor Describe(const MultiScaleFeatures& features, const torch::Tensor& keypoints,
                         cv::Size size) const;

 private:
  struct PlainBlock {
    ConvNorm first, second;
    torch::nn::Conv2d shortcut{nullptr};
  };
  struct DeformableBlock {
    DeformableConvNorm first, second;
    torch::nn::Conv2d shortcut{nullptr};
  };

  torch::nn::Conv2d Register(const std::string& name, torch::nn::Conv2dOptions options);
  torch::nn::BatchNorm2d RegisterNorm(const std::string& name, int channels);
  PlainBlock MakePlainBlock(const std::string& name, int in_channels, int out_channels);
  DeformableBlock MakeDeformableBlock(const std::string& name, int in_channels, int out_channels);
  torch::Tensor Score(const std::vector<torch::Tensor>& levels) const;

  PlainBlock block1_, block2_;
  DeformableBlock block3_, block4_;
  std::vector<torch::nn::Conv2d> level_convs_, score_convs_;
  torch::nn::Conv2d patch_conv_{nullptr}, offset_conv_{nullptr}, sample_conv_{nullptr};
  torch::Tensor place_weights_;
};
TORCH_MODULE(AlikedNetwork);

struct AlikedOptions {
  int top_k = 2048;                  ///< at most so many features, the best ones
  double detection_threshold = 0.2;  ///< of the score of a pixel
  int max_side = 640;                ///< larger images are shrunk to this side, pixels
  void Check() const;                ///< @throws InvalidOption
};

/// ALIKED as detector and descriptor.
class Aliked {
 public:
  /// @param weights named as in `aliked-n16.pth`
  /// @param source the file or model, for messages
  /// @throws BadFile if a tensor is missing, extra or of another shape; InvalidOption
  Aliked(const TensorFile& weights, const std::string& source, const AlikedOptions& options = {},
         torch::Device device = torch::kCPU);

  /// Local maxima of the score in 5 x 5 pixels, to a fraction of a pixel, best first, with
  /// descriptors of length 1.
  /// @param image RGB, 8UC3; one with a side below 32 pixels or of one colour has no features
  LocalFeatures Detect(const cv::Mat& image) const;

 private:
  AlikedNetwork network_;
  AlikedOptions options_;
  torch::Device device_;
};

}  // namespace antipode
