#include "antipode/training/volume_trainer.h"

#include <cmath>
#include <fstream>
#include <memory>
#include <thread>
#include <vector>

#include "antipode/gen6d/shared_backbone.h"
#include "antipode/nn/device.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/precision.h"
#include "antipode/synthesis/object_centric_picture.h"
#include "antipode/training/batch_loader.h"
#include "antipode/training/learning_rate.h"
#include "antipode/training/loss_average.h"
#include "antipode/training/training_state.h"
#include "antipode/training/views_trainer.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/seeds.h"
#include "antipode/util/stopwatch.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using torch::Tensor;
namespace fs = std::filesystem;

constexpr char kCheckpoint[] = "checkpoint.safetensors";
constexpr int kWarmUpSteps = 100;
constexpr int kAllBlocks = 16;

/// Pictures of objects, and how they look from elsewhere.
struct Batch {
  Tensor pictures;  ///< [B, 3, S, S], 0..1, on white
  Tensor views;     ///< [B * K, 3, N, N], 0..1, on white
  Tensor alphas;    ///< [B * K, 1, N, N]
  std::vector<VolumeCamera> cameras;
};

Batch BatchOf(const ViewBatch& drawn, int side) {
  const Tensor rgba = drawn.rgba.to(torch::kFloat) / 255, alpha = rgba.slice(1, 3, 4);
  const Tensor white = rgba.slice(1, 0, 3) * alpha + (1 - alpha);
  const std::size_t views = drawn.camera_from_object.size() / drawn.groups;
  const auto by_object = [&](const Tensor& all) { return all.view({drawn.groups, -1, all.size(1), all.size(2), all.size(3)}); };
  Batch batch{by_object(white).select(1, 0), by_object(Reduced(white, side)).slice(1, 1).flatten(0, 1),
              by_object(Reduced(alpha, side)).slice(1, 1).flatten(0, 1), {}};
  for (std::size_t first = 0; first < drawn.camera_from_object.size(); first += views) {
    const auto cameras = VolumeCamerasOf(std::span(drawn.camera_from_object).subspan(first, views),
                                         std::span(drawn.focal_lengths).subspan(first, views), static_cast<int>(white.size(2)));
    batch.cameras.insert(batch.cameras.end(), cameras.begin() + 1, cameras.end());
  }
  return batch;
}

class Trainer {
 public:
  Trainer(const VolumeTrainingOptions& options, const ViewVolumeConfig& config, const ViewCache& cache, const ProgressCallback& progress)
      : options_(options),
        progress_(progress),
        device_(SelectDevice(options.device)),
        backbone_(LoadSharedBackbone(options.prior)),
        loader_(cache, options.objects_per_step, options.views_per_object, config.image_size, options.augmentation, options.seed) {
    torch::manual_seed(options.seed);
    model_ = ViewVolume(config);
    LoadInto(*model_->backbone, backbone_.tensors, options.prior);
    model_->backbone->AbsorbNormalization();
    model_->backbone->FreezeFirstBlocks(kAllBlocks);
    model_->to(device_);
    std::vector<Tensor> trained;
    for (auto& item : model_->named_parameters()) {
      item.value().set_requires_grad(!IsBackbone(item.key()));
      if (item.value().requires_grad()) trained.push_back(item.value());
    }
    average_ = StartAverage(*model_);
    optimizer_ = std::make_unique<torch::optim::AdamW>(
        trained, torch::optim::AdamWOptions(options.learning_rate).weight_decay(options.weight_decay).betas({0.9, 0.99}));
    if (options.resume) Resume();
  }

  VolumeTrainingResult Run() {
    stopwatch_ = {};
    std::ofstream log(options_.out / "log.csv", options_.resume ? std::ios::app : std::ios::trunc);
    if (!options_.resume) log << "step,minutes,loss\n";
    VolumeTrainingResult result;
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
    TakeAverage();
    if (!result.interrupted && !options_.validation_objects.empty()) Validate(result);
    result.model = SaveAverage(result);
    return result;
  }

 private:
  double Minutes() const { return minutes_before_ + stopwatch_.Seconds() / 60; }
  double Fraction() const {
    return options_.iterations > 0 ? static_cast<double>(step_) / options_.iterations : Minutes() / options_.minutes;
  }

  void Step() {
    torch::manual_seed(CombineSeeds(options_.seed + 1, static_cast<std::uint64_t>(step_)));
    const Batch batch = BatchOf(loader_.Get(step_), options_.rendering.image_size);
    SetLearningRate(*optimizer_, options_.learning_rate * LearningRateFactor(step_, kWarmUpSteps, Fraction()));
    optimizer_->zero_grad();
    Tensor volumes;
    {
      const BFloat16Autocast autocast(device_.type(), device_.is_cuda() || ProcessorHasBFloat16());
      volumes = model_->forward(batch.pictures.to(device_));
    }
    const VolumeViews seen = RenderVolumes(volumes.to(torch::kFloat), batch.cameras, options_.rendering);
    const Tensor loss = (seen.rgb - batch.views.to(device_)).square().mean() +
                        options_.alpha_weight * (seen.alpha - batch.alphas.to(device_)).square().mean();
    losses_.Add(loss.item<double>());
    loss.backward();
    torch::nn::utils::clip_grad_norm_(model_->parameters(), options_.gradient_clip);
    optimizer_->step();
    UpdateAverage(average_, *model_, options_.average_decay, step_);
    ++step_;
  }

  void SaveCheckpoint() {
    TensorFile file;
    file.metadata = model_->config().ToMetadata();
    file.metadata.merge(std::map<std::string, std::string>{{"step", std::to_string(step_)}, {"minutes", std::to_string(Minutes())}});
    AddTrainingState(file, *model_, average_, *optimizer_);
    WriteSafetensors(options_.out / kCheckpoint, file);
  }

  void Resume() {
    const fs::path path = options_.out / kCheckpoint;
    if (!fs::exists(path)) throw BadFile(path.string(), "is missing, there is nothing to resume", "leave out --resume");
    const TensorFile file = SafetensorsReader(path).ReadAll();
    if (ViewVolumeConfig::FromMetadata(file.metadata, path.string()).ToMetadata() != model_->config().ToMetadata())
      throw BadFile(path.string(), "was made with another configuration", "resume with the options it was started with");
    RestoreTrainingState(file, *model_, average_, *optimizer_);
    step_ = std::stoll(file.metadata.at("step"));
    minutes_before_ = std::stod(file.metadata.at("minutes"));
  }

  void TakeAverage() {
    const torch::NoGradGuard no_gradient;
    for (auto& item : model_->named_parameters())
      if (!IsBackbone(item.key())) item.value().copy_(average_.at(item.key()));
    model_->eval();
  }

  /// Views of 64 pixels, the first of every object being the picture.
  void Validate(VolumeTrainingResult& result) {
    if (progress_) progress_({"validating", 0, 0, {}});
    const torch::NoGradGuard no_gradient;
    const TemporaryFolder folder;
    ViewCacheOptions views;
    views.views_per_object = kValidationViews;
    views.variants = 1;
    views.wide_share = 0;
    const ViewCache cache = ViewCache::OpenOrRender(folder.path() / "cache", MeshCollection::Open(options_.validation_objects), views, {});
    const AugmentationOptions none{.level_share = 1, .tilted_share = 0, .level_deviation_deg = 0, .mirror_share = 0, .crop_shift = 0, .crop_scale = 0,
                                   .mask_error_share = 0, .blur_share = 0, .recolor_share = 0};
    BatchLoader loader(cache, cache.group_count(), kValidationViews, model_->config().image_size, none, 1);
    const Batch batch = BatchOf(loader.Get(0), kValidationSide);
    std::int64_t count = 0;
    const auto each = static_cast<std::int64_t>(batch.cameras.size()) / batch.pictures.size(0);
    for (std::int64_t object = 0; object < batch.pictures.size(0); ++object) {
      const Tensor picture = batch.pictures.slice(0, object, object + 1);
      const Tensor volume = model_->forward(picture.to(device_)).to(torch::kFloat);
      const auto cameras = std::span(batch.cameras).subspan(object * each, each);
      const Tensor seen = RenderVolumes(volume, cameras, {.image_size = kValidationSide}).rgb.cpu();
      const Tensor small = Reduced(picture, kValidationSide)[0];
      for (std::int64_t view = 0; view < each; ++view, ++count) {
        const Tensor truth = batch.views[object * each + view];
        result.validation_db += PeakSignalToNoise(seen[view], truth);
        result.picture_db += PeakSignalToNoise(small, truth);
      }
    }
    result.validation_db /= static_cast<double>(count);
    result.picture_db /= static_cast<double>(count);
  }

  fs::path SaveAverage(const VolumeTrainingResult& result) const {
    TensorFile file = WithoutBackbone(WeightsOf(*model_));
    for (auto& [name, tensor] : file.tensors) tensor = ConvertTo(tensor, Dtype::kF16);
    file.metadata = model_->config().ToMetadata();
    file.metadata["backbone_model"] = options_.prior;
    file.metadata["backbone_sha256"] = backbone_.sha256;
    const std::string accuracy =
        result.validation_db > 0 ? Formatted("Views of the validation objects: %.2f dB to the rendering; the picture itself: %.2f dB.\n",
                                             result.validation_db, result.picture_db)
                                 : std::string();
    SaveModel(options_.out, "volume", file, "Coarse volume of an object, seen in one picture of it", "Apache-2.0",
              "# volume\n\nTrained by `antipode train volume`: " + std::to_string(step_) + " steps, seed " + std::to_string(options_.seed) + ".\n" +
                  accuracy);
    return options_.out / "volume";
  }

  static constexpr int kValidationViews = 11, kValidationSide = 64;

  const VolumeTrainingOptions& options_;
  const ProgressCallback& progress_;
  torch::Device device_;
  SharedBackbone backbone_;
  BatchLoader loader_;
  ViewVolume model_{nullptr};
  std::unique_ptr<torch::optim::AdamW> optimizer_;
  MovingAverage average_;
  std::int64_t step_ = 0;
  LossAverage losses_{20};
  double minutes_before_ = 0;
  Stopwatch stopwatch_;
};

}  // namespace

void VolumeTrainingOptions::Check() const {
  if (!(minutes > 0)) throw InvalidOption("minutes", "must be positive");
  if (iterations < 0) throw InvalidOption("iterations", "must not be negative");
  if (objects_per_step < 1) throw InvalidOption("objects_per_step", "must be at least 1");
  if (views_per_object < 2) throw InvalidOption("views_per_object", "leaves no pair", "use at least 2");
  if (!(learning_rate > 0)) throw InvalidOption("learning_rate", "must be positive");
  if (rendering.image_size < 8 || rendering.samples < 4) throw InvalidOption("rendering", "must be of 8 pixels and 4 samples at least");
  views.Check();
}

std::vector<VolumeCamera> VolumeCamerasOf(std::span<const Rigid3> camera_from_object, std::span<const double> focal_lengths, int image_size) {
  const double half = image_size / 2.0;
  const double depth = camera_from_object.front().translation.z();
  const double unit = depth * half / (1 + 2 * kObjectCentricMargin) / focal_lengths.front();
  const Rigid3 object_from_picture = camera_from_object.front().Inverse();
  std::vector<VolumeCamera> cameras;
  for (std::size_t i = 0; i < camera_from_object.size(); ++i) {
    const Rigid3 view_from_picture = camera_from_object[i] * object_from_picture;
    const Eigen::Vector3d middle = view_from_picture * Eigen::Vector3d(0, 0, depth);
    cameras.push_back({{view_from_picture.rotation, middle / unit}, focal_lengths[i] / half});
  }
  return cameras;
}

VolumeTrainingResult TrainVolume(const VolumeTrainingOptions& options, const ViewVolumeConfig& config, const ProgressCallback& progress) {
  options.Check();
  config.Check();
  torch::set_num_threads(options.threads > 0 ? options.threads : static_cast<int>(std::thread::hardware_concurrency()));
  fs::create_directories(options.out);
  const fs::path folder = options.cache.empty() ? options.out / "cache" : options.cache;
  const ViewCache cache = ViewCache::OpenOrRender(folder, MeshCollection::Open(options.objects), options.views, progress);
  return Trainer(options, config, cache, progress).Run();
}

}  // namespace antipode
