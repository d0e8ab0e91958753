#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <torch/torch.h>

#include "antipode/gen6d/image_backbone.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/nn/observation.h"

namespace antipode {

/// The shape of a pose refiner. The default is the published one.
struct RefinerConfig {
  BackboneKind backbone = BackboneKind::kVgg11;
  std::int64_t finest_stride = 4;    ///< of the backbone's three maps; the next are twice and four times that
  std::int64_t feature_width = 64;   ///< of each map; image features are twice as wide
  std::int64_t volume_width = 64;    ///< of the first 3-D convolutions; they end eight times as wide
  std::int64_t grid = 32;            ///< voxels along each axis, a multiple of 8; at 8 the last norm sees one voxel and leaves nothing
  std::int64_t regressor_width = 512;
  void Check() const;

  std::map<std::string, std::string> ToMetadata() const;
  static RefinerConfig FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file);
};

/// The change of an object pose that brings the input camera's picture to the query's.
struct RefinerOutput {
  torch::Tensor rotation;  ///< [B, 4], unit quaternion w x y z
  torch::Tensor offset;    ///< [B, 2], in object units along the camera's x and y
  torch::Tensor scale;     ///< [B, 1], log2 of the scale
};

/// Where a picture was taken from: 128 x 128 pixels, pixel centres at integers.
struct PosedCamera {
  Eigen::Matrix3d intrinsics;
  Rigid3 camera_from_object;
};

/// Image features at a quarter (or `finest_stride`) of the resolution.
class RefinerFeatureNetImpl : public torch::nn::Module {
 public:
  explicit RefinerFeatureNetImpl(const RefinerConfig& config);
  torch::Tensor forward(const torch::Tensor& images);  // [B, 3, 128, 128] -> [B, 2 feature_width, 32, 32]
  ImageBackbone& backbone() { return *backbone_; }

 private:
  std::vector<int> strides_;
  std::shared_ptr<ImageBackbone> backbone_;
  std::vector<torch::nn::Sequential> levels_;
  torch::nn::Sequential conv_out_;
};
TORCH_MODULE(RefinerFeatureNet);

/// 3-D convolutions over the volume of features. Keys as published.
class VolumeNetImpl : public torch::nn::Module {
 public:
  explicit VolumeNetImpl(const RefinerConfig& config);
  /// @param mean_and_query [B, 4 feature_width, G, G, G]
  /// @param deviation [B or 1, 2 feature_width, G, G, G]
  torch::Tensor forward(const torch::Tensor& mean_and_query, const torch::Tensor& deviation);

 private:
  torch::nn::Sequential mean_embed_, var_embed_;
  std::vector<torch::nn::Sequential> convolutions_;
};
TORCH_MODULE(VolumeNet);

class PoseRegressorImpl : public torch::nn::Module {
 public:
  explicit PoseRegressorImpl(const RefinerConfig& config);
  RefinerOutput forward(const torch::Tensor& volume);

 private:
  std::vector<torch::nn::Sequential> fc_;
  torch::nn::Linear fcr_{nullptr}, fct_{nullptr}, fcs_{nullptr};
};
TORCH_MODULE(PoseRegressor);

/// The points of the volume of a camera: a grid over [-1, 1]^3 whose axes are the camera's, in the object's frame.
/// @return [G^3, 3], order x, y, z
torch::Tensor VolumePoints(const Rigid3& camera_from_object, std::int64_t grid);

/// Image features where points appear: zero outside, depth at least 1e-4.
/// @param features [C, h, w] of an image of `image_size` pixels
/// @param points [P, 3], object frame
/// @return [C, P]
torch::Tensor SampleFeatures(const torch::Tensor& features, const PosedCamera& camera, const torch::Tensor& points, int image_size);

/// Improves the pose of an object in a query image given posed reference views near to it (Liu et al., "Gen6D", ECCV
/// 2022): features of all are projected into a volume, where 3-D convolutions compare them. Members are named as in
/// the published checkpoint.
class RefinerImpl : public torch::nn::Module {
 public:
  static constexpr int kImageSize = 128;
  static constexpr std::int64_t kReferences = 6;

  explicit RefinerImpl(const RefinerConfig& config = {});

  torch::Tensor Features(const torch::Tensor& images) { return feature_net_->forward(images); }

  /// @param query [B, C, h, w] features
  /// @param input the B cameras of the query under the poses to be refined
  /// @param references [B, R, C, h, w] features
  /// @param cameras [B][R]
  RefinerOutput forward(const torch::Tensor& query, const std::vector<PosedCamera>& input, const torch::Tensor& references,
                        const std::vector<std::vector<PosedCamera>>& cameras, const Observation& observation = {});

  /// Several queries under one pose with one set of references: their volume is built once.
  /// @param references [R, C, h, w] features
  RefinerOutput ForwardTogether(const torch::Tensor& queries, const PosedCamera& input, const torch::Tensor& references,
                                const std::vector<PosedCamera>& cameras);

  ImageBackbone& backbone() { return feature_net_->backbone(); }
  const RefinerConfig& config() const { return config_; }

  /// Features of the references in the volume.
  struct ReferenceVolume {
    torch::Tensor points;           ///< [G^3, 3], object frame
    torch::Tensor mean, deviation;  ///< [C, G, G, G]
  };
  ReferenceVolume BuildVolume(const PosedCamera& input, const torch::Tensor& references,
                              const std::vector<PosedCamera>& cameras) const;
  /// Those of a query at the same points. [C, G, G, G]
  torch::Tensor QueryIn(const ReferenceVolume& volume, const torch::Tensor& query, const PosedCamera& input) const;

 private:
  RefinerConfig config_;
  RefinerFeatureNet feature_net_{nullptr};
  VolumeNet volume_net_{nullptr};
  PoseRegressor regressor_{nullptr};
};
TORCH_MODULE(Refiner);

}  // namespace antipode
