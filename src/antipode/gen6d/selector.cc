#include "antipode/gen6d/selector.h"

#include <cmath>

#include <Eigen/Geometry>

#include "antipode/gen6d/instance_normalization.h"
#include "antipode/util/error.h"
#include "antipode/weights/metadata_number.h"

namespace antipode {
namespace {

using torch::Tensor;

constexpr double kEpsilon = 1e-5;
const std::vector<int> kStrides{8, 16, 32};

/// Instance norm without parameters whose statistics run over the views too: [D, C, ...] per channel.
Tensor NormalizeJointly(const Tensor& x) {
  return at::batch_norm(x, {}, {}, {}, {}, /*training=*/true, 0, kEpsilon, false);
}

torch::nn::Conv1d Pointwise(std::int64_t inputs, std::int64_t outputs) { return torch::nn::Conv1d(inputs, outputs, 1); }

}  // namespace

void SelectorConfig::Check() const {
  if (correlation_width < 1 || correlation_width > 1024) throw InvalidOption("correlation_width", "must be 1 to 1024");
  if (width < 8 || width > 4096 || width % 4 != 0) throw InvalidOption("width", "must be a multiple of 4 from 8 to 4096");
  if (heads < 1 || width % heads != 0) throw InvalidOption("heads", "must divide the width");
}

std::map<std::string, std::string> SelectorConfig::ToMetadata() const {
  return {{"architecture", "gen6d-selector"},
          {"backbone", NameOf(backbone)},
          {"correlation_width", std::to_string(correlation_width)},
          {"width", std::to_string(width)},
          {"heads", std::to_string(heads)}};
}

SelectorConfig SelectorConfig::FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  const auto architecture = metadata.find("architecture");
  if (architecture == metadata.end() || architecture->second != "gen6d-selector")
    throw BadFile(file, "is not a viewpoint selector (no architecture gen6d-selector in its metadata)",
                  "use a model that 'antipode models import gen6d' or 'antipode train selector' wrote");
  SelectorConfig config;
  config.backbone = BackboneKindOf(metadata.at("backbone"));
  config.correlation_width = MetadataNumber(metadata, "correlation_width", file);
  config.width = MetadataNumber(metadata, "width", file);
  config.heads = MetadataNumber(metadata, "heads", file);
  config.Check();
  return config;
}

ViewwiseConvolutionImpl::ViewwiseConvolutionImpl(std::int64_t inputs, std::int64_t outputs, std::int64_t kernel)
    : weight_(register_parameter("weight", torch::empty({outputs, inputs, 1, kernel, kernel}))),
      bias_(register_parameter("bias", torch::empty({outputs}))) {}

Tensor ViewwiseConvolutionImpl::forward(const Tensor& x) const {
  return at::conv2d(x, weight_.squeeze(2), bias_, 1, weight_.size(4) / 2);
}

CorrelationTowerImpl::CorrelationTowerImpl(std::int64_t inputs, const std::vector<std::int64_t>& widths) {
  for (const std::int64_t width : widths) {
    const std::string place = std::to_string(1 + 3 * convolutions_.size());
    convolutions_.push_back(register_module(place, ViewwiseConvolution(inputs, width, 3)));
    inputs = width;
  }
}

Tensor CorrelationTowerImpl::forward(Tensor x) const {
  for (std::size_t i = 0; i < convolutions_.size(); ++i) {
    const bool begins_block = i % 2 == 0;
    x = NormalizeJointly(x);
    if (begins_block && i > 0) x = at::max_pool2d(x, 2);
    if (!begins_block) x = at::relu(x);
    x = convolutions_[i]->forward(x);
  }
  return x;
}

ViewAttentionImpl::ViewAttentionImpl(std::int64_t width, std::int64_t heads) : heads_(heads) {
  key_ = register_module("conv_key", Pointwise(width, width));
  query_ = register_module("conv_query", Pointwise(width, width));
  feats_ = register_module("conv_feats", Pointwise(width, width));
  merge_ = register_module("conv_merge", Pointwise(width, width));
  struct Norm : torch::nn::Module {};
  const auto holder = register_module("norm", std::make_shared<Norm>());
  norm_ = holder->register_module("norm", LayerNormalization(width));
}

Tensor ViewAttentionImpl::forward(const Tensor& features, const Tensor& source) const {
  const auto split = [&](const Tensor& x) {  // channel = dimension * heads + head; -> [Q, heads, N, dimension]
    return x.view({x.size(0), x.size(1) / heads_, heads_, x.size(2)}).permute({0, 2, 3, 1});
  };
  const Tensor queries = split(query_->forward(features)), keys = split(key_->forward(source));
  const double scale = 1 / std::sqrt(static_cast<double>(queries.size(3)));
  const Tensor weights = at::softmax(at::matmul(queries, keys.transpose(2, 3)) * scale, -1);
  const Tensor message = at::matmul(weights, split(feats_->forward(source)));  // [Q, heads, N, dimension]
  const Tensor merged = merge_->forward(message.permute({0, 3, 1, 2}).reshape(features.sizes()));
  return norm_->forward(merged.transpose(1, 2)).transpose(1, 2);
}

SelectorImpl::SelectorImpl(const SelectorConfig& config) : config_(config) {
  config.Check();
  const std::int64_t narrow = config.correlation_width, width = config.width;
  backbone_ = register_module("backbone", ImageBackbone::Make(config.backbone));
  const auto towers = register_module("corr_conv_list", torch::nn::ModuleList());
  const std::vector<std::vector<std::int64_t>> widths{
      {narrow, narrow, 2 * narrow, 2 * narrow, 4 * narrow, 4 * narrow},
      {2 * narrow, 2 * narrow, 4 * narrow, 4 * narrow},
      {4 * narrow, 4 * narrow}};
  for (std::size_t level = 0; level < kStrides.size(); ++level) {
    towers_.emplace_back(backbone_->ChannelsAt(kStrides[level]), widths[level]);
    towers->push_back(towers_.back());
  }
  struct Holder : torch::nn::Module {};
  const auto join = register_module("corr_feats_conv", std::make_shared<Holder>());
  first_join_ = join->register_module("0", ViewwiseConvolution(3 * 4 * narrow, width, 1));
  second_join_ = join->register_module("3", ViewwiseConvolution(width, width, 1));

  using torch::nn::Conv2d, torch::nn::Linear, torch::nn::ReLU, torch::nn::Sequential;
  const std::int64_t joined = width + static_cast<std::int64_t>(kStrides.size());
  score_process_ = register_module("score_process", Sequential(Conv2d(joined, width, 1), ReLU(), Conv2d(width, width, 1)));
  const auto mixers = register_module("mlps", torch::nn::ModuleList());
  const auto attentions = register_module("atts", torch::nn::ModuleList());
  for (int round = 0; round < 2; ++round) {
    mixers_.emplace_back(Sequential(Pointwise(2 * width, width), InstanceNormalization(), ReLU(), Pointwise(width, width),
                                    InstanceNormalization(), ReLU()));
    mixers->push_back(mixers_.back());
    attentions_.emplace_back(width, config.heads);
    attentions->push_back(attentions_.back());
  }
  score_predict_ = register_module("score_predict", Sequential(Pointwise(width, width), ReLU(), Pointwise(width, 1)));
  angle_predict_ = register_module("angle_predict", Sequential(Pointwise(joined * kAngles, width), ReLU(), Pointwise(width, width),
                                                               ReLU(), Pointwise(width, 1)));
  view_point_encoder_ = register_module("view_point_encoder", Sequential(Linear(3, width / 4), ReLU(), Linear(width / 4, width / 2),
                                                                         ReLU(), Linear(width / 2, width)));
}

SelectorFeatures SelectorImpl::Features(const Tensor& images) { return backbone_->Features(images, kStrides); }

Tensor SelectorImpl::Correlate(std::size_t level, const Tensor& correlations) const { return towers_[level]->forward(correlations); }

Tensor SelectorImpl::Attend(std::size_t round, const Tensor& features) const {
  return attentions_[round]->forward(features, features);
}

Tensor SelectorImpl::Mix(std::size_t round, const Tensor& features, const Tensor& message) const {
  return mixers_[round]->forward(at::cat({features, message}, 1));
}

Tensor SelectorImpl::EmbedViewpoints(const Tensor& viewpoints) { return view_point_encoder_->forward(viewpoints); }

Tensor SelectorImpl::CorrelationFeatures(const std::vector<Tensor>& correlations) const {
  std::vector<Tensor> levels;
  for (std::size_t level = 0; level < correlations.size(); ++level) levels.push_back(Correlate(level, correlations[level]));
  const Tensor joined = second_join_->forward(at::relu(NormalizeJointly(first_join_->forward(at::cat(levels, 1)))));
  return joined.mean({2, 3});
}

/// The features of all views for one query: [1, width + levels, N, A].
Tensor SelectorImpl::CompareViews(const SelectorFeatures& query, std::int64_t index, const SelectorFeatures& references,
                                  const Observation& observation) const {
  const std::int64_t views = references[0].size(0) / kAngles;
  std::vector<Tensor> correlations, similarities;
  for (std::size_t level = 0; level < query.size(); ++level) {
    correlations.push_back(references[level] * query[level].narrow(0, index, 1));
    const Tensor map = correlations.back().sum(1).flatten(1);  // [N A, h w]
    similarities.push_back(map.square().sum(1) / std::get<0>(map.max(1)));
  }
  const Tensor features = CorrelationFeatures(correlations).view({1, views, kAngles, -1}).permute({0, 3, 1, 2});
  const Tensor raw = at::stack(similarities).view({1, -1, views, kAngles});
  const Tensor normalized = NormalizeInstances(raw);
  observation.Show("corr_feats", features);
  observation.Show("vps_raw", raw);
  observation.Show("vps_norm", normalized);
  return at::cat({features, normalized}, 1);
}

SelectorOutput SelectorImpl::forward(const SelectorFeatures& query, const SelectorFeatures& references, const Tensor& viewpoints,
                                     const Observation& observation) {
  std::vector<Tensor> compared;
  for (std::int64_t i = 0; i < query[0].size(0); ++i) compared.push_back(CompareViews(query, i, references, observation));
  const Tensor features = at::cat(compared);  // [Q, width + levels, N, A]
  const Tensor processed = score_process_->forward(features);
  observation.Show("score_process", processed);
  const Tensor embedded = EmbedViewpoints(viewpoints);
  observation.Show("ref_pose_embed", embedded);
  Tensor views = processed.amax(3) + embedded.t().unsqueeze(0);  // [Q, width, N]
  for (std::size_t round = 0; round < attentions_.size(); ++round) {
    const Tensor message = Attend(round, views);
    const Tensor mixed = Mix(round, views, message);
    observation.Show("att" + std::to_string(round), message);
    observation.Show("mlp" + std::to_string(round), mixed);
    views = views + mixed;
  }
  const Tensor by_angle = features.permute({0, 1, 3, 2}).flatten(1, 2);  // channel = feature * A + angle
  return {score_predict_->forward(views).squeeze(1), angle_predict_->forward(by_angle).squeeze(1)};
}

Tensor ViewpointVectors(const std::vector<Eigen::Vector3d>& camera_centres, const Eigen::Vector3d& object_centre,
                        const Eigen::Vector3d& up, std::size_t forward) {
  const Eigen::Vector3d z = up.normalized();
  const Eigen::Vector3d y = z.cross(camera_centres.at(forward) - object_centre).normalized();
  const Eigen::Vector3d x = y.cross(z).normalized();
  Tensor vectors = torch::empty({static_cast<std::int64_t>(camera_centres.size()), 3});
  auto values = vectors.accessor<float, 2>();
  for (std::size_t i = 0; i < camera_centres.size(); ++i) {
    const Eigen::Vector3d direction = (camera_centres[i] - object_centre).normalized();
    const Eigen::Vector3d in_frame(x.dot(direction), y.dot(direction), z.dot(direction));
    for (int axis = 0; axis < 3; ++axis) values[static_cast<std::int64_t>(i)][axis] = static_cast<float>(in_frame[axis]);
  }
  return vectors;
}

}  // namespace antipode
