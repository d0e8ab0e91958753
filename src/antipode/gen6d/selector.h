#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <torch/torch.h>

#include "antipode/gen6d/image_backbone.h"
#include "antipode/nn/layers.h"
#include "antipode/nn/observation.h"

namespace antipode {

/// The shape of a viewpoint selector. The default is the published one.
struct SelectorConfig {
  BackboneKind backbone = BackboneKind::kVgg11;
  std::int64_t correlation_width = 64;  ///< of the first correlation layers; they end four times as wide
  std::int64_t width = 512;             ///< of everything after them
  std::int64_t heads = 8;
  void Check() const;

  std::map<std::string, std::string> ToMetadata() const;
  static SelectorConfig FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file);
};

/// Features of images at strides 8, 16 and 32 [B, C, 128 / stride, 128 / stride].
using SelectorFeatures = std::vector<torch::Tensor>;

/// What the selector says of every reference view.
struct SelectorOutput {
  torch::Tensor logits;  ///< [Q, N], how likely the view is the nearest one
  torch::Tensor angles;  ///< [Q, N], in-plane angle from the view to the query, in units of 90 degrees, clockwise
};

/// A convolution of the pixels of every view whose key has the shape of a 3-D one: [out, in, 1, kernel, kernel].
class ViewwiseConvolutionImpl : public torch::nn::Module {
 public:
  ViewwiseConvolutionImpl(std::int64_t inputs, std::int64_t outputs, std::int64_t kernel);
  torch::Tensor forward(const torch::Tensor& x) const;  // [D, in, h, w] -> [D, out, h, w]

 private:
  torch::Tensor weight_, bias_;
};
TORCH_MODULE(ViewwiseConvolution);

/// Blocks of two convolutions with a halving of the resolution between them, numbered as in the sequence norm, conv,
/// norm, relu, conv, norm, pool.
class CorrelationTowerImpl : public torch::nn::Module {
 public:
  CorrelationTowerImpl(std::int64_t inputs, const std::vector<std::int64_t>& widths);
  torch::Tensor forward(torch::Tensor correlations) const;  // [D, inputs, h, w] -> [D, widths.back(), 4, 4]

 private:
  std::vector<ViewwiseConvolution> convolutions_;
};
TORCH_MODULE(CorrelationTower);

/// Attention among views; `norm.norm` acts over channels. No residual connection.
class ViewAttentionImpl : public torch::nn::Module {
 public:
  ViewAttentionImpl(std::int64_t width, std::int64_t heads);
  torch::Tensor forward(const torch::Tensor& features, const torch::Tensor& source) const;  // [Q, width, N]

 private:
  mutable torch::nn::Conv1d query_{nullptr}, key_{nullptr}, feats_{nullptr}, merge_{nullptr};
  LayerNormalization norm_{nullptr};
  std::int64_t heads_;
};
TORCH_MODULE(ViewAttention);

/// Chooses the posed reference view that is nearest to a query image, and the in-plane rotation between them
/// (Liu et al., "Gen6D: Generalizable Model-Free 6-DoF Object Pose Estimation", ECCV 2022). Every reference comes in
/// five in-plane rotations; features are correlated pixel by pixel, normalised over all references, and the views
/// attend to each other. Logits depend on the whole set of references.
class SelectorImpl : public torch::nn::Module {
 public:
  static constexpr std::int64_t kAngles = 5;  ///< -90, -45, 0, 45 and 90 degrees
  static constexpr std::int64_t kImageSize = 128;

  explicit SelectorImpl(const SelectorConfig& config = {});

  /// @param images [..., 3, 128, 128], RGB in [0, 1]
  SelectorFeatures Features(const torch::Tensor& images);

  /// @param query features of Q images
  /// @param references features of N * kAngles images, view-major
  /// @param viewpoints [N, 3], unit vectors, see ViewpointVectors
  SelectorOutput forward(const SelectorFeatures& query, const SelectorFeatures& references, const torch::Tensor& viewpoints,
                         const Observation& observation = {});

  torch::Tensor EmbedViewpoints(const torch::Tensor& viewpoints);  // [N, 3] -> [N, width]
  ImageBackbone& backbone() { return *backbone_; }
  const SelectorConfig& config() const { return config_; }

  /// The parts of `forward`, for checks.
  torch::Tensor Correlate(std::size_t level, const torch::Tensor& correlations) const;
  torch::Tensor Attend(std::size_t round, const torch::Tensor& features) const;
  torch::Tensor Mix(std::size_t round, const torch::Tensor& features, const torch::Tensor& message) const;

 private:
  torch::Tensor CorrelationFeatures(const std::vector<torch::Tensor>& correlations) const;
  torch::Tensor CompareViews(const SelectorFeatures& query, std::int64_t index, const SelectorFeatures& references,
                             const Observation& observation) const;

  SelectorConfig config_;
  std::shared_ptr<ImageBackbone> backbone_;
  std::vector<CorrelationTower> towers_;
  ViewwiseConvolution first_join_{nullptr}, second_join_{nullptr};
  mutable torch::nn::Sequential score_process_, score_predict_, angle_predict_, view_point_encoder_;
  std::vector<ViewAttention> attentions_;
  mutable std::vector<torch::nn::Sequential> mixers_;
};
TORCH_MODULE(Selector);

/// Directions from the object's centre to the cameras in the frame z = `up`, y = up x centre_forward, x = y x up, as the
/// selector's viewpoint embedding takes them.
/// @param camera_centres in the object's frame
/// @param forward index of the camera that fixes the azimuth: 0, while training a random one
torch::Tensor ViewpointVectors(const std::vector<Eigen::Vector3d>& camera_centres, const Eigen::Vector3d& object_centre,
                               const Eigen::Vector3d& up, std::size_t forward = 0);  // [N, 3]

}  // namespace antipode
