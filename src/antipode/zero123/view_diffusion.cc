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

std::int64_t PoseWidth(PoseCondition pose) { return pose == PoseCondition::kRelativeRotation ? 9 : 4; }

UnetConfig WithChannels(UnetConfig unet) {
  unet.input_channels = 2 * kColors;
  unet.output_channels = kColors;
  return unet;
}

}  // namespace

ViewDiffusionConfig ViewDiffusionConfig::Small(std::int64_t base_width) {
  ViewDiffusionConfig config;
  config.unet.base_width = base_width;
  config.unet.multipliers = {1, 2, 3};
  config.unet.attention_factors = {4};
  config.unet.heads = base_width / 16;
  config.unet.context_width = 192;
  config.unet = WithChannels(config.unet);
  return config;
}

void ViewDiffusionConfig::Check() const {
  if (image_size < 16 || image_size > 512) throw InvalidOption("image_size", "is " + std::to_string(image_size), "use 16 to 512");
  if (patch < 1 || image_size % patch != 0) throw InvalidOption("patch", "must divide the image size");
  unet.Check();
}

std::map<std::string, std::string> ViewDiffusionConfig::ToMetadata() const {
  const nlohmann::json json = {{"image_size", image_size},
                               {"patch", patch},
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
    config.patch = json.at("patch");
    config.target = json.at("target") == "noise" ? DiffusionTarget::kNoise : DiffusionTarget::kVelocity;
    config.pose = json.at("pose") == "zero123" ? PoseCondition::kZero123 : PoseCondition::kRelativeRotation;
    config.unet.base_width = json.at("base_width");
    config.unet.multipliers = json.at("multipliers").get<std::vector<std::int64_t>>();
    config.unet.residual_blocks = json.at("residual_blocks");
    config.unet.attention_factors = json.at("attention_factors").get<std::vector<std::int64_t>>();
    config.unet.heads = json.at("heads");
    config.unet.context_width = json.at("context_width");
    config.unet = WithChannels(config.unet);
    config.Check();
    return config;
  } catch (const nlohmann::json::exception&) {
    throw BadFile(file, "has a malformed configuration in its metadata", "train the model again");
  } catch (const std::out_of_range&) {
    throw BadFile(file, "has no configuration in its metadata", "train the model again");
  }
}

ViewDiffusionImpl::ViewDiffusionImpl(const ViewDiffusionConfig& config) : config_(config) {
  config_.unet = WithChannels(config_.unet);
  config_.Check();
  const std::int64_t width = config_.unet.context_width;
  unet_ = register_module("unet", Unet(config_.unet));
  pose_ = register_module("pose", Dense(PoseWidth(config_.pose), width));
  patches_ = register_module("patches", torch::nn::Conv2d(torch::nn::Conv2dOptions(kColors, width, config_.patch).stride(config_.patch)));
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
                                                     const Tensor& is_conditional) {
  const Tensor shown = is_conditional.view({-1, 1, 1, 1}) * pictures;
  const Tensor patches = patches_->forward(pictures).flatten(2).transpose(1, 2);  // [P, patches, width]
  const Tensor tokens = at::cat({pose_->forward(poses).unsqueeze(1), patches}, 1) * is_conditional.view({-1, 1, 1});
  return {at::cat({noisy, shown}, 1), unet_->Prepare(tokens, ContextPath::kGeneral)};
}

Tensor ViewDiffusionImpl::forward(const Tensor& noisy, const Tensor& pictures, const Tensor& timesteps, const Tensor& poses,
                                  const Tensor& is_conditional) {
  const Input input = Assemble(noisy, pictures, poses, is_conditional);
  return unet_->forward(input.x, timesteps, input.context);
}

Tensor ViewDiffusionImpl::SampleViews(const Tensor& picture, std::span<const ViewCondition> views, std::span<const std::string> names,
                                      const Zero123Options& options, const ProgressCallback& progress) {
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
      const Input input = Assemble(x, pictures, poses, at::full({count}, is_conditional, x.options()));
      const Tensor timesteps = at::full({1}, time.timestep, x.options());
      return NoiseFromTarget(config_.target, PredictWithCache(*unet_, input.x, timesteps, input.context, cache, step, options.full_step_every),
                             x, time.alpha_bar);
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
