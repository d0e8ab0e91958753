#include "antipode/training/views_trainer.h"

#include <cmath>
#include <fstream>
#include <optional>
#include <vector>

#include "antipode/geometry/look_at.h"
#include "antipode/nn/device.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/precision.h"
#include "antipode/synthesis/view_guide.h"
#include "antipode/training/batch_loader.h"
#include "antipode/training/learning_rate.h"
#include "antipode/training/loss_average.h"
#include "antipode/training/training_state.h"
#include "antipode/util/error.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/seeds.h"
#include "antipode/util/stopwatch.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using torch::Tensor;
namespace fs = std::filesystem;

constexpr char kCheckpoint[] = "checkpoint.safetensors";

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
      : options_(options), progress_(progress), device_(SelectDevice(options.device)), guide_(GuideOf(options)), model_(WithGuide(config, guide_)),
        loader_(cache, options.objects_per_step, options.views_per_object, guide_ ? guide_->PictureSize() : config.image_size,
                options.augmentation, options.seed) {
    InitializeForTraining(*model_, options.seed);
    SilenceOutput();
    model_->to(device_);
    average_ = StartAverage(*model_);
    optimizer_ = std::make_unique<torch::optim::AdamW>(model_->parameters(), torch::optim::AdamWOptions(options.learning_rate).weight_decay(0.01));
    if (options.resume) Resume();
  }

  ViewsTrainingResult Run() {
    stopwatch_ = {};
    std::ofstream log(options_.out / "log.csv", options_.resume ? std::ios::app : std::ios::trunc);
    if (!options_.resume) log << "step,minutes,loss\n";
    ViewsTrainingResult result;
    while (Fraction() < 1) {
      Step();
      if (step_ % 20 == 0) log << step_ << ',' << Minutes() << ',' << losses_.last() << std::endl;
      if (progress_) progress_({"training", static_cast<std::int64_t>(1000 * Fraction()), 1000, "loss " + std::to_string(losses_.last())});
      result.interrupted = InterruptRequested();
      if (result.interrupted) break;
    }
    SaveCheckpoint();
    result.steps = step_;
    result.first_loss = losses_.first();
    result.last_loss = losses_.last();
    result.model = SaveAverage();
    return result;
  }

 private:
  double Minutes() const {
    return minutes_before_ + stopwatch_.Seconds() / 60;
  }
  double Fraction() const {
    return options_.iterations > 0 ? static_cast<double>(step_) / options_.iterations : Minutes() / options_.minutes;
  }

  /// A network that says nothing at first learns faster than one that says something wrong.
  void SilenceOutput() {
    const torch::NoGradGuard no_gradient;
    for (auto& item : model_->named_parameters())
      if (item.key().starts_with("unet.out.2.")) item.value().zero_();
  }

  /// The first view of every object is the picture, the others are asked for.
  Batch NextBatch() {
    const ViewBatch drawn = loader_.Get(step_);
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

  void Step() {
    torch::manual_seed(CombineSeeds(options_.seed + 1, static_cast<std::uint64_t>(step_)));
    const Batch batch = NextBatch();
    const auto count = batch.views.size(0);
    const Tensor timesteps = torch::randint(0, NoiseSchedule::kTrainingSteps, {count}, torch::kLong);
    std::vector<float> alphas;
    for (std::int64_t i = 0; i < count; ++i)
      alphas.push_back(static_cast<float>(model_->schedule().At(static_cast<int>(timesteps[i].item<std::int64_t>())).alpha_bar));
    const Tensor alpha_bar = torch::tensor(alphas).view({-1, 1, 1, 1}).to(device_);
    const Tensor noise = torch::randn(batch.views.sizes()).to(device_);
    const Tensor is_conditional = (torch::rand({count}) >= options_.unconditional_share).to(torch::kFloat).to(device_);
    const Tensor noisy = alpha_bar.sqrt() * batch.views + (1 - alpha_bar).sqrt() * noise;
    SetLearningRate(*optimizer_, options_.learning_rate * LearningRateFactor(step_, 0, Fraction()));
    optimizer_->zero_grad();
    Tensor predicted;
    {
      const BFloat16Autocast autocast(device_.type(), device_.is_cuda() || ProcessorHasBFloat16());
      predicted = model_->forward(noisy, batch.pictures, timesteps.to(torch::kFloat).to(device_),
                                  model_->PoseNumbers(batch.conditions).to(device_), is_conditional, batch.guides);
    }
    const Tensor loss = (predicted.to(torch::kFloat) - TargetOf(model_->config().target, batch.views, noise, alpha_bar)).square().mean();
    losses_.Add(loss.item<double>());
    loss.backward();
    torch::nn::utils::clip_grad_norm_(model_->parameters(), options_.gradient_clip);
    optimizer_->step();
    UpdateAverage(average_, *model_, options_.average_decay, step_);
    ++step_;
  }

  void SaveCheckpoint() {
    TensorFile file;
    file.metadata = {{"step", std::to_string(step_)}, {"minutes", std::to_string(Minutes())}};
    file.metadata.merge(model_->config().ToMetadata());
    AddTrainingState(file, *model_, average_, *optimizer_);
    WriteSafetensors(options_.out / kCheckpoint, file);
  }

  void Resume() {
    const fs::path path = options_.out / kCheckpoint;
    if (!fs::exists(path)) throw BadFile(path.string(), "is missing, there is nothing to resume", "leave out --resume");
    const TensorFile file = SafetensorsReader(path).ReadAll();
    if (file.metadata.at("config") != model_->config().ToMetadata().at("config"))
      throw BadFile(path.string(), "was made with another configuration", "resume with the options it was started with");
    RestoreTrainingState(file, *model_, average_, *optimizer_);
    step_ = std::stoll(file.metadata.at("step"));
    minutes_before_ = std::stod(file.metadata.at("minutes"));
  }

  fs::path SaveAverage() const {
    TensorFile file;
    for (const auto& [name, tensor] : average_) file.tensors[name] = ConvertTo(FromTorch(tensor), Dtype::kF16);
    file.metadata = model_->config().ToMetadata();
    if (guide_) file.metadata.merge(guide_->ToMetadata());
    SaveModel(options_.out, "views", file, "Small diffusion model that imagines an object from other viewpoints", "Apache-2.0",
              "# views\n\nTrained by `antipode train views`: " + std::to_string(step_) + " steps, seed " + std::to_string(options_.seed) + ".\n");
    return options_.out / "views";
  }

  const ViewsTrainingOptions& options_;
  const ProgressCallback& progress_;
  torch::Device device_;
  std::optional<ViewGuide> guide_;
  ViewDiffusion model_;
  BatchLoader loader_;
  std::unique_ptr<torch::optim::AdamW> optimizer_;
  MovingAverage average_;
  std::int64_t step_ = 0;
  LossAverage losses_{20};
  double minutes_before_ = 0;
  Stopwatch stopwatch_;
};

}  // namespace

void ViewsTrainingOptions::Check() const {
  if (!(minutes > 0)) throw InvalidOption("minutes", "must be positive");
  if (iterations < 0) throw InvalidOption("iterations", "must not be negative");
  if (objects_per_step < 1) throw InvalidOption("objects_per_step", "must be at least 1");
  if (views_per_object < 2) throw InvalidOption("views_per_object", "leaves no pair", "use at least 2");
  if (!(learning_rate > 0)) throw InvalidOption("learning_rate", "must be positive");
  if (!(unconditional_share >= 0 && unconditional_share < 1)) throw InvalidOption("unconditional_share", "must be at least 0 and less than 1");
  views.Check();
}

ViewsTrainingResult TrainViews(const ViewsTrainingOptions& options, const ViewDiffusionConfig& config, const ProgressCallback& progress) {
  options.Check();
  config.Check();
  fs::create_directories(options.out);
  const fs::path folder = options.cache.empty() ? options.out / "cache" : options.cache;
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
