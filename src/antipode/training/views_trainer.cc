#include "antipode/training/views_trainer.h"

#include <cmath>
#include <optional>
#include <vector>

#include "antipode/geometry/look_at.h"
#include "antipode/nn/device.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/precision.h"
#include "antipode/synthesis/view_guide.h"
#include "antipode/training/batch_loader.h"
#include "antipode/util/error.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using torch::Tensor;
namespace fs = std::filesystem;

struct Batch {
  Tensor pictures, views;  // [P, 3, S, S], -1..1
  Tensor guides;           // nothing without a prior
  std::vector<ViewCondition> conditions;
};

std::optional<ViewGuide> GuideOf(const ViewsTrainingOptions& options) {
  if (options.prior.empty()) return std::nullopt;
  return ViewGuide(options.prior, SelectDevice(options.device));
}

ViewDiffusionConfig WithGuide(ViewDiffusionConfig config, const std::optional<ViewGuide>& guide) {
  config.guide_channels = guide ? guide->Channels() : 0;
  return config;
}

class Trainer {
 public:
  Trainer(const ViewsTrainingOptions& options, const ViewDiffusionConfig& config, const ViewCache& cache, const ProgressCallback& progress)
      : options_(options), device_(SelectDevice(options.device)), guide_(GuideOf(options)), model_(WithGuide(config, guide_)),
        loader_(cache, options.objects_per_step, options.views_per_object, guide_ ? guide_->PictureSize() : config.image_size,
                options.augmentation, options.run.seed) {
    InitializeForTraining(*model_, options.run.seed);
    SilenceOutput();
    model_->to(device_);
    run_.emplace(options.run, *model_, torch::optim::AdamWOptions().weight_decay(0.01), model_->config().ToMetadata(), progress);
  }

  TrainingResult Run() {
    TrainingResult result = run_->Run([this](std::int64_t step) { return AddGradients(step); });
    result.model = SaveAverage(result.steps);
    return result;
  }

 private:
  /// A network that says nothing at first learns faster than one that says something wrong.
  void SilenceOutput() {
    const torch::NoGradGuard no_gradient;
    for (auto& item : model_->named_parameters())
      if (item.key().starts_with("unet.out.2.")) item.value().zero_();
  }

  /// The first view of every object is the picture, the others are asked for.
  Batch BatchOf(const ViewBatch& drawn) {
    const Tensor rgba = drawn.rgba.to(torch::kFloat) / 255, alpha = rgba.slice(1, 3, 4);
    const Tensor white = (rgba.slice(1, 0, 3) * alpha + (1 - alpha)) * 2 - 1;
    const auto count = static_cast<std::int64_t>(drawn.camera_from_object.size());
    const std::int64_t views = count / drawn.groups;
    Batch batch;
    for (std::int64_t i = 0; i < count; ++i) {
      if (i % views == 0) continue;
      batch.conditions.push_back(ConditionOf(drawn.camera_from_object[i / views * views].rotation, drawn.camera_from_object[i].rotation));
    }
    const auto by_object = [&](const Tensor& all) { return all.view({drawn.groups, views, 3, all.size(2), all.size(3)}); };
    const auto for_each_view = [&](const Tensor& of_objects) { return of_objects.repeat_interleave(views - 1, 0); };
    const Tensor small = by_object(Reduced(white, model_->config().image_size));
    batch.views = small.slice(1, 1).flatten(0, 1).to(device_);
    batch.pictures = for_each_view(small.select(1, 0)).to(device_);
    if (guide_) {
      const torch::NoGradGuard no_gradient;
      const Tensor codes = for_each_view(guide_->Encode((by_object(white).select(1, 0) + 1) / 2));
      batch.guides = guide_->Maps(codes, batch.conditions, model_->config().GuideSize()).to(device_);
    }
    return batch;
  }

  static ViewCondition ConditionOf(const Eigen::Matrix3d& picture, const Eigen::Matrix3d& view) {
    const Viewpoint of_picture = ViewpointFromRotation(picture), of_view = ViewpointFromRotation(view);
    return {view * picture.transpose(), {of_picture.elevation - of_view.elevation, of_view.azimuth - of_picture.azimuth, 0}};
  }

  double AddGradients(std::int64_t step) {
    const Batch batch = BatchOf(loader_.Get(step));
    const auto count = batch.views.size(0);
    const Tensor timesteps = torch::randint(0, NoiseSchedule::kTrainingSteps, {count}, torch::kLong);
    std::vector<float> alphas;
    for (std::int64_t i = 0; i < count; ++i)
      alphas.push_back(static_cast<float>(model_->schedule().At(static_cast<int>(timesteps[i].item<std::int64_t>())).alpha_bar));
    const Tensor alpha_bar = torch::tensor(alphas).view({-1, 1, 1, 1}).to(device_);
    const Tensor noise = torch::randn(batch.views.sizes()).to(device_);
    const Tensor is_conditional = (torch::rand({count}) >= options_.unconditional_share).to(torch::kFloat).to(device_);
    const Tensor noisy = alpha_bar.sqrt() * batch.views + (1 - alpha_bar).sqrt() * noise;
    Tensor predicted;
    {
      const BFloat16Autocast autocast(device_.type(), device_.is_cuda() || ProcessorHasBFloat16());
      predicted = model_->forward(noisy, batch.pictures, timesteps.to(torch::kFloat).to(device_),
                                  model_->PoseNumbers(batch.conditions).to(device_), is_conditional, batch.guides);
    }
    const Tensor loss = (predicted.to(torch::kFloat) - TargetOf(model_->config().target, batch.views, noise, alpha_bar)).square().mean();
    loss.backward();
    return loss.item<double>();
  }

  fs::path SaveAverage(std::int64_t steps) const {
    TensorFile file;
    for (const auto& [name, tensor] : run_->average()) file.tensors[name] = ConvertTo(FromTorch(tensor), Dtype::kF16);
    file.metadata = model_->config().ToMetadata();
    if (guide_) file.metadata.merge(guide_->ToMetadata());
    SaveModel(options_.run.out, "views", file, "Small diffusion model that imagines an object from other viewpoints", "Apache-2.0",
              "# views\n\nTrained by `antipode train views`: " + std::to_string(steps) + " steps, seed " + std::to_string(options_.run.seed) + ".\n");
    return options_.run.out / "views";
  }

  const ViewsTrainingOptions& options_;
  torch::Device device_;
  std::optional<ViewGuide> guide_;
  ViewDiffusion model_;
  BatchLoader loader_;
  std::optional<TrainingRun> run_;
};

}  // namespace

void ViewsTrainingOptions::Check() const {
  run.Check();
  if (objects_per_step < 1) throw InvalidOption("objects_per_step", "must be at least 1");
  if (views_per_object < 2) throw InvalidOption("views_per_object", "leaves no pair", "use at least 2");
  if (!(unconditional_share >= 0 && unconditional_share < 1)) throw InvalidOption("unconditional_share", "must be at least 0 and less than 1");
  views.Check();
}

TrainingResult TrainViews(const ViewsTrainingOptions& options, const ViewDiffusionConfig& config, const ProgressCallback& progress) {
  options.Check();
  config.Check();
  fs::create_directories(options.run.out);
  const fs::path folder = options.cache.empty() ? options.run.out / "cache" : options.cache;
  const ViewCache cache = ViewCache::OpenOrRender(folder, MeshCollection::Open(options.objects), options.views, progress);
  return Trainer(options, config, cache, progress).Run();
}

Tensor Reduced(const Tensor& pictures, std::int64_t side) {
  return pictures.size(2) == side ? pictures : at::adaptive_avg_pool2d(pictures, {side, side});
}

double PeakSignalToNoise(const Tensor& picture, const Tensor& truth) {
  return -10 * std::log10(std::max(1e-12, (picture - truth).square().mean().item<double>()));
}

}  // namespace antipode
