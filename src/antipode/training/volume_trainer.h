#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "antipode/synthesis/view_volume.h"
#include "antipode/training/augmentation.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/progress.h"

namespace antipode {

struct VolumeTrainingOptions {
  std::filesystem::path objects;     ///< folder or pack of .glb files
  std::filesystem::path validation_objects;  ///< folder or pack to measure on at the end; may be empty
  std::filesystem::path out;         ///< folder for checkpoint, log.csv and the model volume/
  std::filesystem::path cache;       ///< rendered views; empty: `out / "cache"`
  double minutes = 60;               ///< time budget, counted over all resumed runs
  int iterations = 0;                ///< if positive, the budget instead of `minutes`
  int objects_per_step = 8;
  int views_per_object = 5;          ///< the first one is the picture, the others are rendered from its volume
  double learning_rate = 1.5e-3;     ///< highest; falls along a cosine
  double weight_decay = 0.02;
  double gradient_clip = 1.0;
  double alpha_weight = 0.3;         ///< of the silhouette's error beside the picture's
  double average_decay = 0.998;      ///< of the exponential moving average that is saved as the model
  std::string prior = "prior";       ///< whose backbone it sees with
  VolumeRendering rendering{.image_size = 32, .samples = 24, .jitter = true};
  bool resume = false;
  std::string device = "auto";
  int threads = 0;                   ///< 0: as many as processors
  std::uint64_t seed = 1;
  ViewCacheOptions views;
  AugmentationOptions augmentation{.level_share = 1, .tilted_share = 0, .crop_shift = 0.01, .crop_scale = 0.01, .mask_error_share = 0,
                                   .blur_share = 0, .recolor_share = 0};
  void Check() const;
};

struct VolumeTrainingResult {
  std::int64_t steps = 0;
  double first_loss = 0, last_loss = 0;  ///< means of the first and the last 20 steps of this run
  /// Peak signal-to-noise ratio of views of the validation objects, dB: rendered from the volume, and of the picture itself, the
  /// answer that ignores the viewpoint. 0 where it was not measured.
  double validation_db = 0, picture_db = 0;
  bool interrupted = false;
  std::filesystem::path model;
};

/// The cameras of an object's views relative to the volume of the first one (ViewVolume), from camera_from_object and focal lengths in
/// pixels of square pictures of `image_size`. With z the depth of the object's middle before the picture's camera and r the length
/// that half of its larger side has there, the volume's frame is x_picture = r x_volume + z e_z.
std::vector<VolumeCamera> VolumeCamerasOf(std::span<const Rigid3> camera_from_object, std::span<const double> focal_lengths, int image_size);

/// Trains ViewVolume: mean squared error of the views rendered from the volume, on white, and of their silhouettes.
VolumeTrainingResult TrainVolume(const VolumeTrainingOptions& options, const ViewVolumeConfig& config, const ProgressCallback& progress = {});

}  // namespace antipode
