#include "antipode/zero123/view_diffusion.h"

#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "antipode/nn/layers.h"
#include "antipode/util/error.h"
#include "antipode/zero123/pose_projection.h"

namespace antipode {
namespace {

using torch::Tensor;

constexpr char kArchitecture[] = "view-diffusion-1";
constexpr std::int64_t kColors = 3;
constexpr std::int64_t kGuideWidth = 32;  // of what the network keeps of a guide

std::int64_t PoseWidth(PoseCondition pose) { return pose == PoseCondition::kRelativeRotation ? 9 : 4; }

UnetConfig WithChannels(UnetConfig unet, int cell, int guide_channels) {
  unet.input_channels = 2 * kColors * cell * cell + (guide_channels > 0 ? kGuideWidth : 0);
  unet.output_channels = kColors * cell * cell;
  return unet;
}

}  // namespace

ViewDiffusionConfig ViewDiffusionConfig::Small(std::int64_t base_width, int cell) {
  ViewDiffusionConfig config;
  config.unet.base_width = base_width;
  config.cell = cell;
  config.unet.multipliers = cell < 4 ? std::vector<std::int64_t>{2, 3, 3} : std::vector<std::int64_t>{2, 3};
  config.unet.residual_blocks = 1;
  config.unet.attention_factors = {2};
  config.unet.heads = base_width / 8;
  config.unet.context_width = 192;
  return config;
}

void ViewDiffusionConfig::Check() const {
  if (image_size < 16 || image_size > 512) throw InvalidOption("image_size", "is " + std::to_string(image_size), "use 16 to 512");
  if (cell < 1 || image_size % cell != 0) throw InvalidOption("cell", "must divide the image size");
  if (patch < 1 || image_size % patch != 0) throw InvalidOption("patch", "must divide the image size");
  if (guide_channels < 0 || guide_channels > 4096) throw InvalidOption("guide_channels", "must be 0 to 4096");
  unet.Check();
}

std::map<std::string, std::string> ViewDiffusionConfig::ToMetadata() const {
  const nlohmann::json json = {{"image_size", image_size},
                               {"cell", cell},
                               {"patch", patch},
                               {"guide_channels", guide_channels},
                               {"target", target == DiffusionTarget::kNoise ? "noise" : "velocity"},
                               {"pose", pose == PoseCondition::kZero123 ? "zero123" : "relative rotation"},
                               {"base_width", unet.base_width},
                               {"multipliers", unet.multipliers},
                               {"residual_blocks", unet.residual_blocks},
                               {"attention_factors", unet.attention_factors},
                               {"heads", unet.heads},
                               {"context_width", unet.context_width}};
  return {{"architecture", kArchitecture}, {"config", json.dump()}};
}

bool ViewDiffusionConfig::IsIn(const std::map<std::string, std::string>& metadata) {
  const auto architecture = metadata.find("architecture");
  return architecture != metadata.end() && architecture->second == kArchitecture;
}

ViewDiffusionConfig ViewDiffusionConfig::FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  if (!IsIn(metadata))
    throw BadFile(file, "is no small diffusion model", "use one that 'antipode train views' wrote");
  try {
    const auto json = nlohmann::json::parse(metadata.at("config"));
    ViewDiffusionConfig config;
    config.image_size = json.at("image_size");
    config.cell = json.value("cell", 1);
    config.patch = json.at("patch");
    config.guide_channels = json.value("guide_channels", 0);
    config.target = json.at("target") == "noise" ? DiffusionTarget::kNoise : DiffusionTarget::kVelocity;
    config.pose = json.at("pose") == "zero123" ? PoseCondition::kZero123 : PoseCondition::kRelativeRotation;
    config.unet.base_width = json.at("base_width");
    config.unet.multipliers = json.at("multipliers").get<std::vector<std::int64_t>>();
    config.unet.residual_blocks = json.at("residual_blocks");
    config.unet.attention_factors = json.at("attention_factors").get<std::vector<std::int64_t>>();
    config.unet.heads = json.at("heads");
    config.unet.context_width = json.at("context_width");
    config.Check();
    return config;
  } catch (const nlohmann::json::exception&) {
    throw BadFile(file, "has a malformed configuration in its metadata", "train the model again");
  } catch (const std::out_of_range&) {
    throw BadFile(file, "has no configuration in its metadata", "train the model again");
  }
}

ViewDiffusionImpl::ViewDiffusionImpl(const ViewDiffusionConfig& config) : config_(config) {
  config_.unet = WithChannels(config_.unet, config.cell, config.guide_channels);
  config_.Check();
  const std::int64_t width = config_.unet.context_width;
  unet_ = register_module("unet", Unet(config_.unet));
  pose_ = register_module("pose", Dense(PoseWidth(config_.pose), width));
  patches_ = register_module("patches", torch::nn::Conv2d(torch::nn::Conv2dOptions(kColors, width, config_.patch).stride(config_.patch)));
  if (config_.guide_channels > 0)
    guide_ = register_module("guide", torch::nn::Conv2d(torch::nn::Conv2dOptions(config_.guide_channels, kGuideWidth, 1)));
}

Tensor ViewDiffusionImpl::PoseNumbers(std::span<const ViewCondition> views) const {
  if (config_.pose == PoseCondition::kZero123) {
    std::vector<RelativeView> relative;
    for (const ViewCondition& view : views) relative.push_back(view.relative);
    return PoseVector(relative).flatten(1);
  }
  Tensor numbers = torch::empty({static_cast<std::int64_t>(views.size()), 9});
  for (std::size_t i = 0; i < views.size(); ++i)
    for (int k = 0; k < 9; ++k)
      numbers[static_cast<std::int64_t>(i)][k] = static_cast<float>(views[i].view_from_picture(k / 3, k % 3));
  return numbers;
}

ViewDiffusionImpl::Input ViewDiffusionImpl::Assemble(const Tensor& noisy, const Tensor& pictures, const Tensor& poses,
                                                     const Tensor& is_conditional, const Tensor& guides) {
  const Tensor cells = at::pixel_unshuffle(at::cat({noisy, is_conditional.view({-1, 1, 1, 1}) * pictures}, 1), config_.cell);
  std::vector<Tensor> side_by_side{cells};
  if (guide_) {
    if (!guides.defined()) throw Error("view diffusion", "was trained with guides and got none", "compute them with CodeMaps");
    const Tensor guide = is_conditional.view({-1, 1, 1, 1}) * guide_->forward(guides);
    side_by_side.push_back(at::upsample_bilinear2d(guide, {cells.size(2), cells.size(3)}, /*align_corners=*/false));
  }
  const Tensor patches = patches_->forward(pictures).flatten(2).transpose(1, 2);  // [P, patches, width]
  const Tensor tokens = at::cat({pose_->forward(poses).unsqueeze(1), patches}, 1) * is_conditional.view({-1, 1, 1});
  return {at::cat(side_by_side, 1), unet_->Prepare(tokens, ContextPath::kGeneral)};
}

Tensor ViewDiffusionImpl::forward(const Tensor& noisy, const Tensor& pictures, const Tensor& timesteps, const Tensor& poses,
                                  const Tensor& is_conditional, const Tensor& guides) {
  const Input input = Assemble(noisy, pictures, poses, is_conditional, guides);
  return at::pixel_shuffle(unet_->forward(input.x, timesteps, input.context), config_.cell);
}

Tensor ViewDiffusionImpl::SampleViews(const Tensor& picture, std::span<const ViewCondition> views, std::span<const std::string> names,
                                      const Zero123Options& options, const Tensor& guides, const ProgressCallback& progress) {
  options.Check();
  const torch::InferenceMode inference;
  const auto count = static_cast<std::int64_t>(views.size());
  const Tensor pictures = picture.expand({count, -1, -1, -1}), poses = PoseNumbers(views).to(picture.device());
  const SamplerInput times = TimesOf(options, schedule_);
  const int evaluations = static_cast<int>(times.times.size());
  std::array<UnetCache, 2> caches;  // with picture and pose, and without
  const auto predict = [&](const Tensor& x, const DiffusionTime& time, int step) {
    if (progress) progress({"denoising", step, evaluations, {}});
    const double share = static_cast<double>(step) / evaluations;
    const bool is_guided = options.guidance_scale != 1 && share >= options.guidance_begin && share < options.guidance_end;
    const auto noise_of = [&](double is_conditional, UnetCache& cache) {
      const Input input = Assemble(x, pictures, poses, at::full({count}, is_conditional, x.options()), guides);
      const Tensor timesteps = at::full({1}, time.timestep, x.options());
      const Tensor cells = PredictWithCache(*unet_, input.x, timesteps, input.context, cache, step, options.full_step_every);
      return NoiseFromTarget(config_.target, at::pixel_shuffle(cells, config_.cell), x, time.alpha_bar);
    };
    const Tensor conditional = noise_of(1, caches[0]);
    return is_guided ? Guided(noise_of(0, caches[1]), conditional, options.guidance_scale) : conditional;
  };
  const auto noise = [&](int step) {
    std::vector<Tensor> drawn;
    for (const std::string& name : names) drawn.push_back(ViewNoise(options.seed, name, step, picture.sizes().slice(1)));
    return at::stack(drawn).to(picture.device());
  };
  constexpr int kStart = -1;
  const Tensor images = Sample(options.solver, predict, noise(kStart), times, noise);
  return ((images + 1) / 2).clamp(0, 1);
}

Tensor NoiseFromTarget(DiffusionTarget target, const Tensor& prediction, const Tensor& x, double alpha_bar) {
  if (target == DiffusionTarget::kNoise) return prediction;
  return std::sqrt(alpha_bar) * prediction + std::sqrt(1 - alpha_bar) * x;
}

Tensor TargetOf(DiffusionTarget target, const Tensor& clean, const Tensor& noise, const Tensor& alpha_bar) {
  if (target == DiffusionTarget::kNoise) return noise;
  return alpha_bar.sqrt() * noise - (1 - alpha_bar).sqrt() * clean;
}

}  // namespace antipode
