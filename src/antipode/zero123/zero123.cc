#include "antipode/zero123/zero123.h"

#include <algorithm>
#include <map>
#include <memory>

#include <nlohmann/json.hpp>

#include "antipode/nn/module_weights.h"
#include "antipode/util/error.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

constexpr int kStart = -1;  // the step of the start noise

torch::Tensor NoiseOfViews(std::uint64_t seed, std::span<const std::string> names, int step, at::IntArrayRef shape) {
  std::vector<torch::Tensor> noises;
  for (const std::string& name : names) noises.push_back(ViewNoise(seed, name, step, shape));
  return at::stack(noises);
}

/// The tensors whose names start with `prefix`, without it.
LazyTensorFile Part(const LazyTensorFile& file, const std::string& prefix) {
  LazyTensorFile part;
  for (const auto& [name, tensor] : file.tensors)
    if (name.starts_with(prefix)) part.tensors[name.substr(prefix.size())] = tensor;
  return part;
}

constexpr char kConfigKey[] = "zero123_config";
constexpr char kLayoutKey[] = "denoiser_convolutions", kChannelsLast[] = "channels last";

bool IsDenoisersConvolution(const std::string& name, const LazyTensor& tensor) {
  return name.starts_with("unet.") && tensor.shape.size() == 4;
}

LazyTensorFile OpenWeights(const std::string& model_or_folder) {
  LazyTensorFile file = OpenModel(model_or_folder);
  const auto layout = file.metadata.find(kLayoutKey);
  if (layout == file.metadata.end()) return file;
  if (layout->second != kChannelsLast)
    throw BadFile(model_or_folder, "stores its convolutions in an unknown way", "import the model again");
  for (auto& [name, tensor] : file.tensors)
    if (IsDenoisersConvolution(name, tensor)) tensor = FromChannelsLast(tensor);
  return file;
}

/// Calls `field(name, value)` for every number or list of numbers of the configuration.
template <typename Config, typename Field>
void ForEachField(Config& config, const Field& field) {
  field("unet_input_channels", config.unet.input_channels);
  field("unet_output_channels", config.unet.output_channels);
  field("unet_base_width", config.unet.base_width);
  field("unet_multipliers", config.unet.multipliers);
  field("unet_residual_blocks", config.unet.residual_blocks);
  field("unet_attention_factors", config.unet.attention_factors);
  field("unet_heads", config.unet.heads);
  field("unet_transformer_depth", config.unet.transformer_depth);
  field("unet_context_width", config.unet.context_width);
  field("autoencoder_image_channels", config.autoencoder.image_channels);
  field("autoencoder_latent_channels", config.autoencoder.latent_channels);
  field("autoencoder_base_width", config.autoencoder.base_width);
  field("autoencoder_multipliers", config.autoencoder.multipliers);
  field("autoencoder_residual_blocks", config.autoencoder.residual_blocks);
  field("clip_width", config.clip.width);
  field("clip_layers", config.clip.layers);
  field("clip_heads", config.clip.heads);
  field("clip_patch", config.clip.patch);
  field("clip_output_width", config.clip.output_width);
  field("clip_image_size", config.clip.image_size);
}

}  // namespace

void Zero123Options::Check() const {
  if (steps < 1 || steps > NoiseSchedule::kTrainingSteps)
    throw InvalidOption("steps", "is " + std::to_string(steps), "use 1 to 1000");
  if (!(eta >= 0 && eta <= 1)) throw InvalidOption("eta", "must be between 0 and 1");
  if (!(guidance_scale >= 0 && guidance_scale <= 100)) throw InvalidOption("guidance_scale", "must be between 0 and 100");
  if (!(guidance_begin >= 0 && guidance_begin <= guidance_end && guidance_end <= 1))
    throw InvalidOption("guidance interval", "is no part of 0 to 1", "use 0 and 1 for all steps");
  if (full_step_every < 1) throw InvalidOption("full_step_every", "must be at least 1");
}

Zero123Options Zero123Options::Fast() {
  return {.solver = Solver::kDpmSolverPlusPlus, .steps = 8, .eta = 0, .guidance_begin = 0, .guidance_end = 0.5,
          .full_step_every = 2};
}

SamplerInput TimesOf(const Zero123Options& options, const NoiseSchedule& schedule) {
  if (options.solver == Solver::kDdim) return {schedule.PublishedTimes(options.steps), schedule.At(0), options.eta};
  return {schedule.EvenTimes(options.steps), DiffusionTime{0, 1}, 0};
}

Zero123::Zero123(const Zero123Config& config)
    : unet(config.unet), autoencoder(config.autoencoder), clip(config.clip), projection(config.unet.context_width) {}

std::map<std::string, std::string> Zero123Config::ToMetadata() const {
  nlohmann::json json;
  ForEachField(*this, [&](const char* name, const auto& value) { json[name] = value; });
  return {{kConfigKey, json.dump()}};
}

Zero123Config Zero123Config::FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  Zero123Config config;
  const auto found = metadata.find(kConfigKey);
  if (found == metadata.end()) return config;
  try {
    const auto json = nlohmann::json::parse(found->second);
    ForEachField(config, [&](const char* name, auto& value) { json.at(name).get_to(value); });
  } catch (const nlohmann::json::exception&) {
    throw BadFile(file, "has a malformed configuration in its metadata", "import or train the model again");
  }
  config.unet.Check();
  return config;
}

Zero123 Zero123::Load(const std::string& model_or_folder, torch::Device device, DenoiserPrecision precision) {
  const LazyTensorFile file = OpenWeights(model_or_folder);
  Zero123 model(Zero123Config::FromMetadata(file.metadata, model_or_folder));
  if (precision == DenoiserPrecision::kBFloat16) model.unet->to(torch::kBFloat16);
  LoadInto(*model.unet, Part(file, "unet."), model_or_folder);
  LoadInto(*model.autoencoder, Part(file, "autoencoder."), model_or_folder);
  LoadInto(*model.clip, Part(file, "clip."), model_or_folder);
  LoadInto(*model.projection, Part(file, "projection."), model_or_folder);
  for (torch::nn::Module* module : std::initializer_list<torch::nn::Module*>{&*model.unet, &*model.autoencoder, &*model.clip, &*model.projection})
    module->to(device);
  UseChannelsLast(*model.unet);
  return model;
}

LazyTensorFile StoredForUse(LazyTensorFile file) {
  file.metadata[kLayoutKey] = kChannelsLast;
  for (auto& [name, tensor] : file.tensors)
    if (IsDenoisersConvolution(name, tensor)) tensor = ToChannelsLast(tensor);
  return file;
}

PictureConditioning Zero123::Condition(const torch::Tensor& picture) const {
  return {clip->forward(picture).unsqueeze(1), autoencoder->Encode(picture)};
}

ViewConditioning Zero123::Prepare(const PictureConditioning& picture, std::span<const RelativeView> viewpoints,
                                  ContextPath path) const {
  const auto poses = PoseVector(viewpoints).to(picture.embedding.device());
  const auto tokens = projection->forward(picture.embedding, poses);
  const auto latent = picture.latent.expand({poses.size(0), -1, -1, -1});
  return {latent, unet->Prepare(at::cat({at::zeros_like(tokens), tokens}), path), unet->Prepare(tokens, path)};
}

NoisePredictor Zero123::Predictor(const ViewConditioning& views, const Zero123Options& options, int evaluations,
                                  const Observation& observation) const {
  // One cache for each kind of batch: both halves, or the conditional one alone.
  const auto caches = std::make_shared<std::map<bool, UnetCache>>();
  return [this, &views, options, evaluations, observation, caches](const torch::Tensor& x, const DiffusionTime& time, int step) {
    const double share = static_cast<double>(step) / evaluations;
    const bool is_guided = options.guidance_scale != 1 && share >= options.guidance_begin && share < options.guidance_end;
    const auto conditional = at::cat({x, views.latent}, 1);
    const auto input = is_guided ? at::cat({at::cat({x, at::zeros_like(views.latent)}, 1), conditional}) : conditional;
    const auto timestep = at::full({1}, time.timestep, x.options());
    const UnetContext& context = is_guided ? views.guided : views.alone;
    UnetCache& cache = (*caches)[is_guided];
    const torch::Tensor noise = PredictWithCache(*unet, input, timestep, context, cache, step, options.full_step_every);
    observation.Show("step" + std::to_string(step) + ".eps_uncond_cond", noise);
    if (!is_guided) return noise;
    const auto halves = noise.chunk(2);
    return Guided(halves[0], halves[1], options.guidance_scale);
  };
}

torch::Tensor Zero123::SampleLatents(const PictureConditioning& picture, std::span<const RelativeView> viewpoints,
                                     std::span<const std::string> names, const Zero123Options& options,
                                     const ProgressCallback& progress) const {
  options.Check();
  if (viewpoints.empty() || viewpoints.size() != names.size())
    throw InvalidOption("views", "number " + std::to_string(viewpoints.size()), "ask for at least one, each with a name");
  const ViewConditioning views = Prepare(picture, viewpoints, options.context_path);
  const SamplerInput times = TimesOf(options, schedule);
  const auto shape = picture.latent.sizes().slice(1);
  const auto device = picture.latent.device();
  const int evaluations = static_cast<int>(times.times.size());
  const NoisePredictor predict = Predictor(views, options, evaluations);
  const auto with_progress = [&](const torch::Tensor& x, const DiffusionTime& time, int step) {
    if (progress) progress({"denoising", step, evaluations, {}});
    return predict(x, time, step);
  };
  return Sample(options.solver, with_progress, NoiseOfViews(options.seed, names, kStart, shape).to(device), times,
                [&](int step) { return NoiseOfViews(options.seed, names, step, shape).to(device); });
}

torch::Tensor Zero123::Decode(const torch::Tensor& latents) const {
  const auto images = ((autoencoder->Decode(latents / kLatentScale) + 1) / 2).clamp(0, 1);
  if (!images.isfinite().all().item<bool>()) throw Error("Zero123", "made pictures that are not finite numbers");
  return images;
}

}  // namespace antipode
