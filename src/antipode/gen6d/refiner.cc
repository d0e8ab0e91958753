#include "antipode/gen6d/refiner.h"

#include "antipode/gen6d/instance_normalization.h"
#include "antipode/util/error.h"
#include "antipode/weights/metadata_number.h"

namespace antipode {
namespace {

using torch::Tensor;
using torch::nn::Conv2d, torch::nn::Conv3d, torch::nn::Linear, torch::nn::ReLU, torch::nn::Sequential;

constexpr double kLeakySlope = 0.1;

Conv2d Conv(std::int64_t inputs, std::int64_t outputs) {
  return Conv2d(torch::nn::Conv2dOptions(inputs, outputs, 3).padding(1));
}

Conv3d VolumeConv(std::int64_t inputs, std::int64_t outputs, std::int64_t stride = 1) {
  return Conv3d(torch::nn::Conv3dOptions(inputs, outputs, 3).padding(1).stride(stride));
}

Tensor ToTensor(const Eigen::MatrixXd& matrix, const torch::TensorOptions& options) {
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = matrix;
  return torch::from_blob(const_cast<double*>(rows.data()), {rows.rows(), rows.cols()}, torch::kDouble).to(options).clone();
}

}  // namespace

void RefinerConfig::Check() const {
  if (finest_stride != 4 && finest_stride != 8) throw InvalidOption("finest_stride", "must be 4 or 8");
  if (feature_width < 1 || feature_width > 1024) throw InvalidOption("feature_width", "must be 1 to 1024");
  if (volume_width < 1 || volume_width > 1024) throw InvalidOption("volume_width", "must be 1 to 1024");
  if (grid < 8 || grid > 128 || grid % 8 != 0) throw InvalidOption("grid", "must be a multiple of 8 from 8 to 128");
  if (regressor_width < 1 || regressor_width > 8192) throw InvalidOption("regressor_width", "must be 1 to 8192");
}

std::map<std::string, std::string> RefinerConfig::ToMetadata() const {
  return {{"architecture", "gen6d-refiner"},
          {"backbone", NameOf(backbone)},
          {"finest_stride", std::to_string(finest_stride)},
          {"feature_width", std::to_string(feature_width)},
          {"volume_width", std::to_string(volume_width)},
          {"grid", std::to_string(grid)},
          {"regressor_width", std::to_string(regressor_width)}};
}

RefinerConfig RefinerConfig::FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  const auto architecture = metadata.find("architecture");
  if (architecture == metadata.end() || architecture->second != "gen6d-refiner")
    throw BadFile(file, "is not a pose refiner (no architecture gen6d-refiner in its metadata)",
                  "use a model that 'antipode models import gen6d' or 'antipode train refiner' wrote");
  RefinerConfig config;
  config.backbone = BackboneKindOf(metadata.at("backbone"));
  config.finest_stride = MetadataNumber(metadata, "finest_stride", file);
  config.feature_width = MetadataNumber(metadata, "feature_width", file);
  config.volume_width = MetadataNumber(metadata, "volume_width", file);
  config.grid = MetadataNumber(metadata, "grid", file);
  config.regressor_width = MetadataNumber(metadata, "regressor_width", file);
  config.Check();
  return config;
}

RefinerFeatureNetImpl::RefinerFeatureNetImpl(const RefinerConfig& config) {
  const std::int64_t width = config.feature_width;
  backbone_ = register_module("backbone", ImageBackbone::Make(config.backbone));
  for (int level = 0; level < 3; ++level) {
    strides_.push_back(static_cast<int>(config.finest_stride) << level);
    const std::int64_t hidden = level == 0 ? width : 4 * width;
    levels_.push_back(register_module("conv" + std::to_string(level),
                                      Sequential(Conv(backbone_->ChannelsAt(strides_.back()), hidden), InstanceNormalization(),
                                                 ReLU(), Conv(hidden, width), InstanceNormalization())));
  }
  conv_out_ = register_module("conv_out", Sequential(Conv(3 * width, 2 * width), InstanceNormalization(), ReLU(),
                                                     Conv(2 * width, 2 * width), InstanceNormalization()));
}

Tensor RefinerFeatureNetImpl::forward(const Tensor& images) {
  const std::vector<Tensor> maps = backbone_->Features(images, strides_);
  std::vector<Tensor> levels;
  for (std::size_t level = 0; level < maps.size(); ++level) {
    const Tensor features = levels_[level]->forward(maps[level]);
    levels.push_back(level == 0 ? features
                                : at::upsample_bilinear2d(features, {maps[0].size(2), maps[0].size(3)}, /*align_corners=*/false));
  }
  return conv_out_->forward(at::cat(levels, 1));
}

VolumeNetImpl::VolumeNetImpl(const RefinerConfig& config) {
  const std::int64_t features = 2 * config.feature_width, width = config.volume_width;
  const auto embed = [&](std::int64_t inputs) {
    return Sequential(VolumeConv(inputs, width), InstanceNormalization(), ReLU(), VolumeConv(width, width));
  };
  mean_embed_ = register_module("mean_embed", embed(2 * features));
  var_embed_ = register_module("var_embed", embed(features));
  struct Layer {
    std::int64_t inputs, outputs, stride;
  };
  const std::vector<Layer> layers{{2, 1, 1}, {1, 2, 2}, {2, 2, 1}, {2, 4, 2}, {4, 4, 1}};
  for (const Layer& layer : layers)
    convolutions_.push_back(register_module(
        "conv" + std::to_string(convolutions_.size()),
        Sequential(VolumeConv(layer.inputs * width, layer.outputs * width, layer.stride), InstanceNormalization(), ReLU())));
  convolutions_.push_back(register_module("conv5", Sequential(VolumeConv(4 * width, 8 * width, 2), InstanceNormalization(), ReLU(),
                                                              VolumeConv(8 * width, 8 * width))));
}

Tensor VolumeNetImpl::forward(const Tensor& mean_and_query, const Tensor& deviation) {
  const Tensor comparison = mean_embed_->forward(mean_and_query);
  Tensor x = at::cat({comparison, var_embed_->forward(deviation).expand_as(comparison)}, 1);
  for (auto& convolution : convolutions_) x = convolution->forward(x);
  return x;
}

PoseRegressorImpl::PoseRegressorImpl(const RefinerConfig& config) {
  const std::int64_t side = config.grid / 8, width = config.regressor_width;
  const auto list = register_module("fc", torch::nn::ModuleList());
  for (const std::int64_t inputs : {8 * config.volume_width * side * side * side, width}) {
    fc_.push_back(Sequential(Linear(inputs, width),
                             torch::nn::LeakyReLU(torch::nn::LeakyReLUOptions().negative_slope(kLeakySlope))));
    list->push_back(fc_.back());
  }
  fcr_ = register_module("fcr", Linear(width, 4));
  fct_ = register_module("fct", Linear(width, 2));
  fcs_ = register_module("fcs", Linear(width, 1));
}

RefinerOutput PoseRegressorImpl::forward(const Tensor& volume) {
  Tensor x = volume.flatten(1);
  for (auto& layer : fc_) x = layer->forward(x);
  const Tensor quaternion = fcr_->forward(x);
  return {quaternion / quaternion.norm(2, 1, true).clamp_min(1e-12), fct_->forward(x), fcs_->forward(x)};
}

Tensor VolumePoints(const Rigid3& camera_from_object, std::int64_t grid) {
  const Tensor line = torch::linspace(-1, 1, grid, torch::kFloat);
  const auto axes = torch::meshgrid({line, line, line}, "ij");
  const Tensor in_camera = torch::stack({axes[0], axes[1], axes[2]}, -1).view({-1, 3});
  return at::matmul(in_camera, ToTensor(camera_from_object.rotation, torch::kFloat));  // rows: v^T R = (R^T v)^T
}

Tensor SampleFeatures(const Tensor& features, const PosedCamera& camera, const Tensor& points, int image_size) {
  const auto options = points.options();
  const Tensor rotation = ToTensor(camera.camera_from_object.rotation, options);
  const Tensor translation = ToTensor(camera.camera_from_object.translation.transpose(), options);
  const Tensor in_camera = at::matmul(points, rotation.t()) + translation;  // [P, 3]
  const Tensor projected = at::matmul(in_camera, ToTensor(camera.intrinsics, options).t());
  const Tensor pixels = projected.slice(1, 0, 2) / projected.slice(1, 2, 3).clamp_min(1e-4);
  const Tensor normalized = (pixels + 0.5) / image_size * 2 - 1;
  return at::grid_sampler(features.unsqueeze(0), normalized.view({1, 1, -1, 2}).to(features.scalar_type()), /*bilinear*/ 0,
                          /*zeros*/ 0, /*align_corners=*/false)
      .flatten(1)
      .view({features.size(0), -1});
}

RefinerImpl::RefinerImpl(const RefinerConfig& config) : config_(config) {
  config.Check();
  feature_net_ = register_module("feature_net", RefinerFeatureNet(config));
  volume_net_ = register_module("volume_net", VolumeNet(config));
  regressor_ = register_module("regressor", PoseRegressor(config));
}

RefinerImpl::ReferenceVolume RefinerImpl::BuildVolume(const PosedCamera& input, const Tensor& references,
                                                      const std::vector<PosedCamera>& cameras) const {
  const std::int64_t grid = config_.grid;
  const Tensor points = VolumePoints(input.camera_from_object, grid).to(references.device());
  std::vector<Tensor> views;
  for (std::size_t i = 0; i < cameras.size(); ++i)
    views.push_back(SampleFeatures(references[static_cast<std::int64_t>(i)], cameras[i], points, kImageSize));
  const Tensor stacked = at::stack(views);
  const auto as_volume = [&](const Tensor& values) { return values.view({-1, grid, grid, grid}); };
  return {points, as_volume(stacked.mean(0)), as_volume(stacked.std(0))};
}

Tensor RefinerImpl::QueryIn(const ReferenceVolume& volume, const Tensor& query, const PosedCamera& input) const {
  return SampleFeatures(query, input, volume.points, kImageSize).view(volume.mean.sizes());
}

RefinerOutput RefinerImpl::forward(const Tensor& query, const std::vector<PosedCamera>& input, const Tensor& references,
                                   const std::vector<std::vector<PosedCamera>>& cameras, const Observation& observation) {
  std::vector<Tensor> means, deviations;
  for (std::size_t i = 0; i < input.size(); ++i) {
    const auto index = static_cast<std::int64_t>(i);
    const ReferenceVolume volume = BuildVolume(input[i], references[index], cameras[i]);
    means.push_back(at::cat({volume.mean, QueryIn(volume, query[index], input[i])}));
    deviations.push_back(volume.deviation);
  }
  const Tensor mean_and_query = at::stack(means), deviation = at::stack(deviations);
  observation.Show("volume_mean_query", mean_and_query);
  observation.Show("volume_std", deviation);
  const Tensor volume = volume_net_->forward(mean_and_query, deviation);
  observation.Show("volume_out", volume);
  return regressor_->forward(volume);
}

RefinerOutput RefinerImpl::ForwardTogether(const Tensor& queries, const PosedCamera& input, const Tensor& references,
                                           const std::vector<PosedCamera>& cameras) {
  const ReferenceVolume volume = BuildVolume(input, references, cameras);
  std::vector<Tensor> together;
  for (const Tensor& query : queries.unbind()) together.push_back(at::cat({volume.mean, QueryIn(volume, query, input)}));
  return regressor_->forward(volume_net_->forward(at::stack(together), volume.deviation.unsqueeze(0)));
}

}  // namespace antipode
