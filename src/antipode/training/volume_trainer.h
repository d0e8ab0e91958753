#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "antipode/synthesis/view_volume.h"
#include "antipode/training/augmentation.h"
#include "antipode/training/training_run.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/progress.h"

namespace antipode {

struct VolumeTrainingOptions {
  std::filesystem::path objects;     ///< folder or pack of .glb files
  std::filesystem::path validation_objects;  ///< folder or pack to measure on at the end; may be empty
  std::filesystem::path cache;       ///< rendered views; empty: `run.out / "cache"`
  TrainingRunOptions run{.learning_rate = 1.5e-3, .warm_up_steps = 100, .average_decay = 0.998};
  int objects_per_step = 8;
  int views_per_object = 5;          ///< the first one is the picture, the others are rendered from its volume
  double weight_decay = 0.02;
  double alpha_weight = 0.3;         ///< of the silhouette's error beside the picture's
  std::string prior = "prior";       ///< whose backbone it sees with
  VolumeRendering rendering{.image_size = 32, .samples = 24, .jitter = true};
  std::string device = "auto";
  int threads = 0;                   ///< 0: as many as processors
  ViewCacheOptions views;
  AugmentationOptions augmentation{.level_share = 1, .tilted_share = 0, .crop_shift = 0.01, .crop_scale = 0.01, .mask_error_share = 0,
                                   .blur_share = 0, .compression_share = 0, .cut_share = 0, .recolor_share = 0};
  void Check() const;
};

struct VolumeTrainingResult : TrainingResult {
  /// Peak signal-to-noise ratio of views of the validation objects, dB: rendered from the volume, and of the picture itself, the
  /// answer that ignores the viewpoint. 0 where it was not measured.
  double validation_db = 0, picture_db = 0;
};

/// The cameras of an object's views relative to the volume of the first one (ViewVolume), from camera_from_object and focal lengths in
/// pixels of square pictures of `image_size`. With z the depth of the object's middle before the picture's camera and r the length
/// that half of its larger side has there, the volume's frame is x_picture = r x_volume + z e_z.
std::vector<VolumeCamera> VolumeCamerasOf(std::span<const Rigid3> camera_from_object, std::span<const double> focal_lengths, int image_size);

/// How the volume of an object's picture shows it from another viewpoint. All [1, 3, 64, 64], 0..1, on white.
struct ShownView {
  torch::Tensor picture, truth, shown;
};

/// Renders objects from `views` + 1 random viewpoints each, and shows the volume of the first picture from the others.
void ShowViews(ViewVolume& network, const std::filesystem::path& meshes, int views, torch::Device device,
               const std::function<void(const ShownView&)>& use);

/// Trains ViewVolume: mean squared error of the views rendered from the volume, on white, and of their silhouettes.
VolumeTrainingResult TrainVolume(const VolumeTrainingOptions& options, const ViewVolumeConfig& config, const ProgressCallback& progress = {});

}  // namespace antipode
