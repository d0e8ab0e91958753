#pragma once

#include <string>
#include <vector>

#include <torch/torch.h>
#include <opencv2/core.hpp>

#include "antipode/matching/conv_norm.h"
#include "antipode/matching/local_features.h"
#include "antipode/weights/safetensors.h"

namespace antipode {

/// What the network says about an image of H x W pixels, in cells of 8 x 8 pixels.
struct XFeatMaps {
  torch::Tensor descriptors;  ///< [N, 64, H/8, W/8], not normalised
  /// [N, 65, H/8, W/8]: the cell's pixels row by row, and "no keypoint"
  torch::Tensor keypoint_logits;
  torch::Tensor reliability;  ///< [N, 1, H/8, W/8], 0..1
};

/// The network of XFeat (Potje et al., "XFeat: Accelerated Features for Lightweight Image
/// Matching", CVPR 2024). Parameters are named as in the published checkpoint `xfeat.pt`.
class XFeatNetworkImpl : public torch::nn::Module {
 public:
  XFeatNetworkImpl();

  /// Derives from the parameters what the other methods use; to be called again when they or their
  /// device change.
  void Prepare();

  /// @param grey [N, 1, H, W], H and W multiples of 32; each image is normalised inside to mean 0
  /// and variance 1
  XFeatMaps forward(const torch::Tensor& grey) const;

  /// Where the query's cell lies in the reference's, for K pairs of matched descriptors [K, 64]
  /// each: logits [K, 64] over the pixels of the cell, row by row.
  torch::Tensor RefinementLogits(const torch::Tensor& reference, const torch::Tensor& query) const;

 private:
  using Block = std::vector<ConvNorm>;  // with ReLU after each
  void Append(Block& block, const std::string& name, torch::nn::Conv2dOptions options);
  torch::nn::Conv2d Convolution(const std::string& name, int in_channels, int out_channels);

  torch::nn::Conv2d skip_{nullptr}, fusion_{nullptr}, reliability_{nullptr}, keypoints_{nullptr};
  Block block1_, block2_, block3_, block4_, block5_, fusion_block_, reliability_block_,
      keypoint_block_;
  std::vector<torch::nn::Linear> refinement_;
  std::vector<torch::nn::BatchNorm1d> refinement_norms_;
};
TORCH_MODULE(XFeatNetwork);

struct XFeatOptions {
  int top_k = 2048;                   ///< at most so many features, the best ones
  double detection_threshold = 0.05;  ///< of the keypoint probability of a pixel
  int max_side = 640;                 ///< larger images are shrunk to this side, pixels
  void Check() const;                 ///< @throws InvalidOption
};

/// Features on a grid of cells instead of at corners, from two scales of the image.
struct SemiDenseFeatures {
  /// Descriptors are not normalised; keypoints are the upper left pixels of the cells.
  LocalFeatures features;
  torch::Tensor scales;  ///< [N] float32: side of a cell's pixel, in pixels of the image
};

/// XFeat as detector and descriptor.
class XFeat {
 public:
  /// @param weights named as in `xfeat.pt`
  /// @param source the file or model, for messages
  /// @throws BadFile if a tensor is missing, extra or of another shape; InvalidOption
  XFeat(const TensorFile& weights, const std::string& source, const XFeatOptions& options = {},
        torch::Device device = torch::kCPU);

  /// Local maxima of the keypoint probability in 5 x 5 pixels, best first by probability times
  /// reliability, with descriptors of length 1. The network sees the image resized to sides that
  /// are multiples of 32.
  /// @param image RGB, 8UC3; one with a side below 32 pixels or of one colour has no features
  LocalFeatures Detect(const cv::Mat& image) const;

  /// XFeat*: the most reliable cells, a fifth of them from the image at 0.6 times its size, the
  /// others at 1.3 times.
  /// @param image as for `Detect`
  SemiDenseFeatures DetectSemiDense(const cv::Mat& image) const;

  /// See `XFeatNetworkImpl::RefinementLogits`.
  torch::Tensor RefinementLogits(const torch::Tensor& reference, const torch::Tensor& query) const;

 private:
  SemiDenseFeatures DetectCells(const torch::Tensor& grey, double scale, double share) const;

  XFeatNetwork network_;
  XFeatOptions options_;
  torch::Device device_;
};

}  // namespace antipode
