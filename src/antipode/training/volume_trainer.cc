#include "antipode/training/volume_trainer.h"

#include <cmath>
#include <map>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "antipode/gen6d/shared_backbone.h"
#include "antipode/nn/device.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/precision.h"
#include "antipode/synthesis/object_centric_picture.h"
#include "antipode/training/batch_loader.h"
#include "antipode/training/views_trainer.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using torch::Tensor;
namespace fs = std::filesystem;

constexpr int kAllBlocks = 16;
constexpr int kValidationViews = 10, kShownSide = 64;

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
        loader_(cache, options.objects_per_step, options.views_per_object, config.image_size, options.augmentation, options.run.seed) {
    torch::manual_seed(options.run.seed);
    model_ = ViewVolume(config);
    LoadInto(*model_->backbone, backbone_.tensors, options.prior);
    model_->backbone->AbsorbNormalization();
    model_->backbone->FreezeFirstBlocks(kAllBlocks);
    model_->to(device_);
    for (auto& item : model_->named_parameters()) item.value().set_requires_grad(!IsBackbone(item.key()));
    std::map<std::string, std::string> configuration = config.ToMetadata();
    configuration["backbone_sha256"] = backbone_.sha256;
    run_.emplace(options.run, *model_, torch::optim::AdamWOptions().weight_decay(options.weight_decay).betas({0.9, 0.99}), std::move(configuration),
                 progress);
  }

  VolumeTrainingResult Run() {
    VolumeTrainingResult result{run_->Run([this](std::int64_t step) { return AddGradients(step); })};
    run_->TakeAverage();
    model_->eval();
    if (!result.interrupted && !options_.validation_objects.empty()) Validate(result);
    result.model = SaveAverage(result);
    return result;
  }

 private:
  double AddGradients(std::int64_t step) {
    const Batch batch = BatchOf(loader_.Get(step), options_.rendering.image_size);
    Tensor volumes;
    {
      const BFloat16Autocast autocast(device_.type(), device_.is_cuda() || ProcessorHasBFloat16());
      volumes = model_->forward(batch.pictures.to(device_));
    }
    const VolumeViews seen = RenderVolumes(volumes.to(torch::kFloat), batch.cameras, options_.rendering);
    const Tensor loss = (seen.rgb - batch.views.to(device_)).square().mean() +
                        options_.alpha_weight * (seen.alpha - batch.alphas.to(device_)).square().mean();
    loss.backward();
    return loss.item<double>();
  }

  void Validate(VolumeTrainingResult& result) {
    if (progress_) progress_({"validating", 0, 0, {}});
    std::int64_t count = 0;
    ShowViews(model_, options_.validation_objects, kValidationViews, device_, [&](const ShownView& view) {
      ++count;
      result.validation_db += (PeakSignalToNoise(view.shown, view.truth) - result.validation_db) / static_cast<double>(count);
      result.picture_db += (PeakSignalToNoise(view.picture, view.truth) - result.picture_db) / static_cast<double>(count);
    });
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
    SaveModel(options_.run.out, "volume", file, "Coarse volume of an object, seen in one picture of it", "Apache-2.0",
              "# volume\n\nTrained by `antipode train volume`: " + std::to_string(result.steps) + " steps, seed " + std::to_string(options_.run.seed) + ".\n" +
                  accuracy);
    return options_.run.out / "volume";
  }

  const VolumeTrainingOptions& options_;
  const ProgressCallback& progress_;
  torch::Device device_;
  SharedBackbone backbone_;
  BatchLoader loader_;
  ViewVolume model_{nullptr};
  std::optional<TrainingRun> run_;
};

}  // namespace

void VolumeTrainingOptions::Check() const {
  run.Check();
  if (objects_per_step < 1) throw InvalidOption("objects_per_step", "must be at least 1");
  if (views_per_object < 2) throw InvalidOption("views_per_object", "leaves no pair", "use at least 2");
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

void ShowViews(ViewVolume& network, const fs::path& meshes, int views, torch::Device device, const std::function<void(const ShownView&)>& use) {
  const torch::NoGradGuard no_gradient;
  const TemporaryFolder folder;
  ViewCacheOptions rendering;
  rendering.views_per_object = views + 1;
  rendering.variants = 1;
  rendering.wide_share = 0;
  const ViewCache cache = ViewCache::OpenOrRender(folder.path() / "cache", MeshCollection::Open(meshes), rendering, {});
  const int size = network->config().image_size;
  for (int group = 0; group < cache.group_count(); ++group) {
    std::vector<Rigid3> poses;
    std::vector<double> focal_lengths;
    std::vector<Tensor> pictures;
    for (int view = 0; view <= views; ++view) {
      const AugmentedView plain = PlainView(cache, group, view, size);
      poses.push_back(plain.camera_from_object);
      focal_lengths.push_back(plain.focal_length);
      pictures.push_back(OnWhite(plain));
    }
    const Tensor volume = network->forward(pictures.front().to(device)).to(torch::kFloat);
    const std::vector<VolumeCamera> cameras = VolumeCamerasOf(poses, focal_lengths, size);
    const Tensor shown = RenderVolumes(volume, std::span(cameras).subspan(1), {.image_size = kShownSide}).rgb.cpu();
    const Tensor picture = Reduced(pictures.front(), kShownSide);
    for (int view = 1; view <= views; ++view) use({picture, Reduced(pictures[view], kShownSide), shown.slice(0, view - 1, view)});
  }
}

VolumeTrainingResult TrainVolume(const VolumeTrainingOptions& options, const ViewVolumeConfig& config, const ProgressCallback& progress) {
  options.Check();
  config.Check();
  torch::set_num_threads(options.threads > 0 ? options.threads : static_cast<int>(std::thread::hardware_concurrency()));
  fs::create_directories(options.run.out);
  const fs::path folder = options.cache.empty() ? options.run.out / "cache" : options.cache;
  const ViewCache cache = ViewCache::OpenOrRender(folder, MeshCollection::Open(options.objects), options.views, progress);
  return Trainer(options, config, cache, progress).Run();
}

}  // namespace antipode
