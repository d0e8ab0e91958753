#include "antipode/synthesis/view_volume.h"

#include <cmath>

#include "antipode/util/error.h"
#include "antipode/weights/metadata_fields.h"

namespace antipode {
namespace {

using torch::Tensor;
namespace nn = torch::nn;

constexpr char kArchitecture[] = "view-volume-1";
constexpr int kStride8 = 40, kStride16 = 112, kStride32 = 320;  // channels of the backbone
constexpr int kNormGroups = 8;
constexpr double kReach = 1.75;        // of the rays before and behind the middle of the volume
constexpr double kDensityScale = 10;   // of the densities per unit
constexpr double kLogitScale = 2;      // lets a quiet network already say much
constexpr double kDensityOffset = -2;  // at first the volume is thin

constexpr MetadataField<ViewVolumeConfig> kFields[] = {
    {"image_size", &ViewVolumeConfig::image_size, 32, 512}, {"width", &ViewVolumeConfig::width, 1, 4096},
    {"layers", &ViewVolumeConfig::layers, 1, 64},           {"heads", &ViewVolumeConfig::heads, 1, 64},
    {"feed_forward", &ViewVolumeConfig::feed_forward, 1, 16384}, {"fine", &ViewVolumeConfig::fine, kNormGroups, 4096},
    {"finest", &ViewVolumeConfig::finest, kNormGroups, 4096}, {"depth", &ViewVolumeConfig::depth, 2, 512},
};

Tensor ChannelsLast(const Tensor& x) { return x.permute({0, 2, 3, 1}); }
Tensor ChannelsFirst(const Tensor& x) { return x.permute({0, 3, 1, 2}); }

nn::Conv2d Convolution(int channels) { return nn::Conv2d(nn::Conv2dOptions(channels, channels, 3).padding(1)); }

/// x + convolutions of it.
Tensor Residual(const Tensor& x, nn::GroupNorm& norm, nn::Conv2d& first, nn::Conv2d& second) {
  return x + second(torch::gelu(first(torch::gelu(norm(x)))));
}

}  // namespace

void ViewVolumeConfig::Check() const {
  CheckFields(kFields, *this);
  if (image_size % 32 != 0) throw InvalidOption("image_size", "must be a multiple of 32");
  if (width % heads != 0) throw InvalidOption("width", "must be a multiple of heads");
  if (fine % kNormGroups != 0 || finest % kNormGroups != 0) throw InvalidOption("fine and finest", "must be multiples of 8");
}

std::map<std::string, std::string> ViewVolumeConfig::ToMetadata() const {
  std::map<std::string, std::string> metadata{{"architecture", kArchitecture}};
  WriteFields(kFields, *this, metadata);
  return metadata;
}

bool ViewVolumeConfig::IsIn(const std::map<std::string, std::string>& metadata) {
  const auto architecture = metadata.find("architecture");
  return architecture != metadata.end() && architecture->second == kArchitecture;
}

ViewVolumeConfig ViewVolumeConfig::FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  if (!IsIn(metadata))
    throw BadFile(file, std::string("is no volume of views (no architecture ") + kArchitecture + " in its metadata)",
                  "use a model that 'antipode train volume' wrote");
  ViewVolumeConfig config;
  ReadFields(kFields, metadata, file, config);
  config.Check();
  return config;
}

ViewVolumeImpl::ViewVolumeImpl(const ViewVolumeConfig& config) : config_(config) {
  config.Check();
  const auto norm = [](int width) { return nn::LayerNorm(nn::LayerNormOptions({width})); };
  backbone = register_module("backbone", EfficientNetLite0());
  norm8 = register_module("norm8", norm(kStride8));
  norm16 = register_module("norm16", norm(kStride16));
  norm32 = register_module("norm32", norm(kStride32));
  norm_out = register_module("norm_out", norm(config.width));
  project8 = register_module("project8", nn::Linear(kStride8, config.fine));
  project16 = register_module("project16", nn::Linear(kStride16, config.width));
  project32 = register_module("project32", nn::Linear(kStride32, config.width));
  layers = register_module("layers", nn::ModuleList());
  for (int i = 0; i < config.layers; ++i) layers->push_back(TransformerLayer(config.width, config.heads, config.feed_forward));
  const std::int64_t side = config.image_size / 16;
  position = register_parameter("position", 0.02 * torch::randn({side * side, config.width}));
  expand8 = register_module("expand8", nn::Linear(config.width, 4 * config.fine));
  norm_fine = register_module("norm_fine", nn::GroupNorm(nn::GroupNormOptions(kNormGroups, config.fine)));
  fine1 = register_module("fine1", Convolution(config.fine));
  fine2 = register_module("fine2", Convolution(config.fine));
  expand4 = register_module("expand4", nn::Conv2d(nn::Conv2dOptions(config.fine, 4 * config.finest, 1)));
  norm_finest = register_module("norm_finest", nn::GroupNorm(nn::GroupNormOptions(kNormGroups, config.finest)));
  finest1 = register_module("finest1", Convolution(config.finest));
  finest2 = register_module("finest2", Convolution(config.finest));
  to_columns = register_module("to_columns", nn::Conv2d(nn::Conv2dOptions(config.finest, 4 * config.depth, 1)));
}

Tensor ViewVolumeImpl::forward(const Tensor& images) {
  FeaturePyramid features;
  {
    const torch::NoGradGuard no_gradient;
    features = backbone->forward(images);
  }
  const std::int64_t side = config_.image_size / 16;
  const Tensor coarse = ChannelsFirst(project32(norm32(ChannelsLast(features.stride32))));
  const Tensor upsampled = at::upsample_bilinear2d(coarse, {side, side}, /*align_corners=*/false);
  Tensor tokens = (project16(norm16(ChannelsLast(features.stride16))) + ChannelsLast(upsampled)).flatten(1, 2) + position;
  for (const auto& layer : *layers) tokens = layer->as<TransformerLayer>()->forward(tokens);
  const Tensor expanded = expand8(norm_out(tokens)).transpose(1, 2).reshape({images.size(0), -1, side, side});
  Tensor x = torch::pixel_shuffle(expanded, 2) + ChannelsFirst(project8(norm8(ChannelsLast(features.stride8))));
  x = Residual(x, norm_fine, fine1, fine2);
  x = Residual(torch::pixel_shuffle(expand4(x), 2), norm_finest, finest1, finest2);
  return to_columns(torch::gelu(x)).view({images.size(0), 4, config_.depth, 4 * side, 4 * side});
}

namespace {

/// Where the samples of the rays of all cameras lie, in volume coordinates: [N, S * S, samples, 3].
Tensor SampleRays(std::span<const VolumeCamera> cameras, const VolumeRendering& rendering) {
  const auto count = static_cast<std::int64_t>(cameras.size());
  const std::int64_t side = rendering.image_size;
  Tensor rotation = torch::empty({count, 3, 3}), translation = torch::empty({count, 3}), focal_length = torch::empty({count, 1, 1});
  for (std::int64_t i = 0; i < count; ++i) {
    const VolumeCamera& camera = cameras[static_cast<std::size_t>(i)];
    for (int row = 0; row < 3; ++row) {
      translation[i][row] = camera.camera_from_volume.translation[row];
      for (int column = 0; column < 3; ++column) rotation[i][row][column] = camera.camera_from_volume.rotation(row, column);
    }
    focal_length[i] = camera.focal_length;
  }
  const Tensor pixel = (torch::arange(side) + 0.5) * (2.0 / static_cast<double>(side)) - 1;
  const std::vector<Tensor> grid = torch::meshgrid({pixel, pixel}, "ij");
  const Tensor in_plane = torch::stack({grid[1], grid[0]}, -1).view({1, side * side, 2}) / focal_length;
  const Tensor direction = torch::cat({in_plane, torch::ones({count, side * side, 1})}, 2);
  const Tensor within = rendering.jitter ? torch::rand({count, 1, rendering.samples}) : torch::full({count, 1, rendering.samples}, 0.5);
  const Tensor along = (torch::arange(rendering.samples) + within) * (2.0 / rendering.samples) - 1;
  const Tensor depth = (translation.select(1, 2).view({count, 1, 1}) + kReach * along).clamp_min(1e-3);
  // Rows times R are R^T times columns: x_volume = R^T (x_camera - t).
  const Tensor turned_direction = torch::matmul(direction, rotation), turned_origin = torch::matmul(translation.unsqueeze(1), rotation);
  const Tensor extent = torch::tensor({kVolumeExtent[0], kVolumeExtent[1], kVolumeExtent[2]}, torch::kFloat);
  return (turned_direction.unsqueeze(2) * depth.unsqueeze(3) - turned_origin.unsqueeze(2)) / extent;
}

}  // namespace

VolumeViews RenderVolumes(const Tensor& volumes, std::span<const VolumeCamera> cameras, const VolumeRendering& rendering) {
  const std::int64_t batch = volumes.size(0), count = static_cast<std::int64_t>(cameras.size()), each = count / batch;
  if (each * batch != count || count == 0) throw Error("volume rendering", "was not given the same number of cameras for each volume");
  const std::int64_t side = rendering.image_size, samples = rendering.samples;
  const Tensor grid = SampleRays(cameras, rendering).to(volumes.device()).view({batch, each * side * side, samples, 1, 3});
  const Tensor sampled = at::grid_sampler(volumes, grid, /*bilinear*/ 0, /*zeros*/ 0, /*align_corners=*/false).squeeze(-1);
  const Tensor is_inside = (grid.abs().amax(-1) < 1).squeeze(-1);
  const Tensor density = torch::softplus(kLogitScale * sampled.select(1, 3) + kDensityOffset) * is_inside;
  const Tensor alpha = 1 - torch::exp(-density * (kDensityScale * 2 * kReach / static_cast<double>(samples)));
  const Tensor passed = torch::cumprod(torch::cat({torch::ones_like(alpha.slice(2, 0, 1)), 1 - alpha + 1e-6}, 2), 2);
  const Tensor weights = alpha * passed.slice(2, 0, samples);
  const Tensor colors = torch::sigmoid(kLogitScale * sampled.slice(1, 0, 3));
  const Tensor rgb = (colors * weights.unsqueeze(1)).sum(3) + passed.slice(2, samples).transpose(1, 2);
  return {rgb.view({batch, 3, each, side, side}).transpose(1, 2).reshape({count, 3, side, side}),
          weights.sum(2).view({count, 1, side, side})};
}

}  // namespace antipode
