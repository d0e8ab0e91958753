#include "antipode/prior/object_encoder.h"

#include <cmath>

#include "antipode/geometry/spherical_harmonics.h"
#include "antipode/util/error.h"
#include "antipode/weights/metadata_fields.h"

namespace antipode {
namespace {

namespace F = torch::nn::functional;
using torch::Tensor;

constexpr int kStride = 16;

constexpr MetadataField<ObjectEncoderConfig> kFields[] = {
    {"image_size", &ObjectEncoderConfig::image_size, 32, 1024},
    {"max_degree", &ObjectEncoderConfig::max_degree, 1, 16},
    {"channels", &ObjectEncoderConfig::channels, 1, 512},
    {"width", &ObjectEncoderConfig::width, 1, 4096},
    {"layers", &ObjectEncoderConfig::layers, 0, 64},
    {"heads", &ObjectEncoderConfig::heads, 1, 64},
    {"feed_forward", &ObjectEncoderConfig::feed_forward, 1, 16384},
    {"spatial_bases", &ObjectEncoderConfig::spatial_bases, 1, 256},
};

/// Harmonics of the point of the unit sphere that the centre of each token sees: on the front for even
/// bases, on the back for odd ones. [K, tokens, (L+1)^2]
Tensor SphereBasis(int bases, int side, int max_degree) {
  const int harmonics = SphericalHarmonicCount(max_degree);
  Tensor basis = torch::zeros({bases, side * side, harmonics});
  auto values = basis.accessor<float, 3>();
  for (int k = 0; k < bases; ++k) {
    for (int p = 0; p < side * side; ++p) {
      Eigen::Vector3d direction((p % side + 0.5) * 2 / side - 1, (p / side + 0.5) * 2 / side - 1, 0);
      const double in_plane = direction.squaredNorm();
      const double toward_camera = k % 2 == 0 ? -1 : 1;
      if (in_plane < 1) direction.z() = toward_camera * std::sqrt(1 - in_plane);
      const Eigen::VectorXd y = SphericalHarmonics(direction.normalized(), max_degree);
      for (int i = 0; i < harmonics; ++i) values[k][p][i] = static_cast<float>(y[i]);
    }
  }
  return basis / side;
}

/// Zero for a share of the entries, and such that the mean stays 1.
Tensor DropoutMask(const std::vector<std::int64_t>& shape, double share, const Tensor& like) {
  return torch::empty(shape, like.options()).bernoulli_(1 - share) / (1 - share);
}

Tensor Flatten(const Tensor& map) { return map.flatten(2).transpose(1, 2); }  // -> [N, HW, C]

}  // namespace

void ObjectEncoderConfig::Check() const {
  CheckFields(kFields, *this, "prior.");
  if (image_size % 32 != 0) throw InvalidOption("prior.image_size", "is not a multiple of 32");
  if (width % heads != 0) throw InvalidOption("prior.heads", "does not divide the width");
}

std::map<std::string, std::string> ObjectEncoderConfig::ToMetadata() const {
  std::map<std::string, std::string> metadata{{"architecture", "object-encoder-1"}};
  WriteFields(kFields, *this, metadata);
  return metadata;
}

ObjectEncoderConfig ObjectEncoderConfig::FromMetadata(
    const std::map<std::string, std::string>& metadata, const std::string& file) {
  const auto architecture = metadata.find("architecture");
  if (architecture == metadata.end() || architecture->second != "object-encoder-1")
    throw BadFile(file, "is not an object prior (no architecture object-encoder-1 in its metadata)",
                  "use a model that 'antipode train prior' wrote");
  ObjectEncoderConfig config;
  ReadFields(kFields, metadata, file, config);
  config.Check();
  return config;
}

TransformerLayerImpl::TransformerLayerImpl(int width, int heads, int feed_forward) : heads_(heads) {
  norm1 = register_module("norm1", torch::nn::LayerNorm(torch::nn::LayerNormOptions({width})));
  norm2 = register_module("norm2", torch::nn::LayerNorm(torch::nn::LayerNormOptions({width})));
  to_qkv = register_module("to_qkv", torch::nn::Linear(width, 3 * width));
  to_out = register_module("to_out", torch::nn::Linear(width, width));
  expand = register_module("expand", torch::nn::Linear(width, feed_forward));
  contract = register_module("contract", torch::nn::Linear(feed_forward, width));
}

torch::Tensor TransformerLayerImpl::forward(torch::Tensor tokens, double branch_dropout) {
  const auto batch = tokens.size(0), count = tokens.size(1), width = tokens.size(2);
  const auto thinned = [&](const Tensor& branch) {
    return branch_dropout > 0 ? branch * DropoutMask({batch, 1, 1}, branch_dropout, branch) : branch;
  };
  const auto qkv = to_qkv(norm1(tokens))
                       .view({batch, count, 3, heads_, width / heads_})
                       .permute({2, 0, 3, 1, 4});  // [3, N, heads, T, width / heads]
  // Written out: for so few tokens the fused kernel's backward pass is several times slower on the CPU.
  const double scale = 1 / std::sqrt(static_cast<double>(width / heads_));
  const auto weights = torch::softmax(torch::matmul(qkv[0] * scale, qkv[1].transpose(2, 3)), -1);
  const auto attended = torch::matmul(weights, qkv[2]).transpose(1, 2).reshape({batch, count, width});
  tokens = tokens + thinned(to_out(attended));
  return tokens + thinned(contract(torch::gelu(expand(norm2(tokens)))));
}

ObjectEncoderImpl::ObjectEncoderImpl(const ObjectEncoderConfig& config) : config_(config) {
  config.Check();
  const auto norm = [](int width) { return torch::nn::LayerNorm(torch::nn::LayerNormOptions({width})); };
  const int side = config.image_size / kStride;
  backbone = register_module("backbone", EfficientNetLite0());
  norm8 = register_module("norm8", norm(4 * 40));
  norm16 = register_module("norm16", norm(112));
  norm32 = register_module("norm32", norm(320));
  project8 = register_module("project8", torch::nn::Linear(4 * 40, config.width));
  project16 = register_module("project16", torch::nn::Linear(112, config.width));
  project32 = register_module("project32", torch::nn::Linear(320, config.width));
  layers = register_module("layers", torch::nn::ModuleList());
  for (int i = 0; i < config.layers; ++i)
    layers->push_back(TransformerLayer(config.width, config.heads, config.feed_forward));
  norm_out = register_module("norm_out", norm(config.width));
  to_values = register_module(
      "to_values", torch::nn::Linear(config.width, config.spatial_bases * config.channels));
  position = register_parameter("position", 0.02 * torch::randn({side * side, config.width}));
  const Tensor basis = SphereBasis(config.spatial_bases, side, config.max_degree);
  spatial_basis = register_parameter("spatial_basis", basis + 0.3 * basis.std() * torch::randn_like(basis));
  degree_gain = register_parameter("degree_gain", torch::zeros({config.max_degree + 1}));
  log_norm = register_parameter("log_norm", torch::ones({1}));
}

Tensor ObjectEncoderImpl::Tokens(const FeaturePyramid& features) {
  const auto coarse = torch::upsample_nearest2d(features.stride32, {features.stride16.size(2), features.stride16.size(3)});
  const auto fine = torch::pixel_unshuffle(features.stride8, 2);  // [N, 160, H/16, W/16]
  Tensor tokens = project8(norm8(Flatten(fine))) + project16(norm16(Flatten(features.stride16))) +
                  project32(norm32(Flatten(coarse)));
  if (is_training() && dropout_.tokens > 0)
    tokens = tokens * DropoutMask({tokens.size(0), tokens.size(1), 1}, dropout_.tokens, tokens);
  return tokens + position;
}

Tensor ObjectEncoderImpl::CodeFromFeatures(const FeaturePyramid& features) {
  Tensor tokens = Tokens(features);
  const double branch_dropout = is_training() ? dropout_.branches : 0;
  for (const auto& layer : *layers) tokens = layer->as<TransformerLayer>()->forward(tokens, branch_dropout);
  const auto batch = tokens.size(0), count = tokens.size(1);
  const auto values = to_values(norm_out(tokens))
                          .view({batch, count, config_.spatial_bases, config_.channels})
                          .permute({0, 3, 2, 1})
                          .reshape({batch * config_.channels, config_.spatial_bases * count});
  const auto basis = spatial_basis.view({config_.spatial_bases * count, -1});
  Tensor code = torch::matmul(values, basis).to(torch::kFloat).view({batch, config_.channels, -1});

  std::vector<Tensor> gains;
  const auto gain = torch::softplus(degree_gain);
  for (int l = 0; l <= config_.max_degree; ++l) gains.push_back(gain[l].expand({2 * l + 1}));
  code = code * torch::cat(gains);
  const auto length = code.flatten(1).norm(2, 1).clamp_min(1e-6).view({-1, 1, 1});
  return code / length * torch::exp(log_norm);
}

Tensor ObjectEncoderImpl::forward(const Tensor& images) { return CodeFromFeatures(Features(images)); }

}  // namespace antipode
