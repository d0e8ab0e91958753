#pragma once

#include <filesystem>
#include <string>

#include "antipode/training/augmentation.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/progress.h"
#include "antipode/zero123/view_diffusion.h"

namespace antipode {

struct ViewsTrainingOptions {
  std::filesystem::path objects;  ///< folder or pack of .glb files
  std::filesystem::path out;      ///< folder for checkpoint, log.csv and the model views/
  std::filesystem::path cache;    ///< rendered views; empty: `out / "cache"`
  double minutes = 60;            ///< time budget, counted over all resumed runs
  int iterations = 0;             ///< if positive, the budget instead of `minutes`
  int objects_per_step = 4;
  int views_per_object = 5;       ///< the others are asked for, given the first one
  double learning_rate = 2e-4;    ///< highest; falls along a cosine
  double gradient_clip = 1.0;
  double unconditional_share = 0.1;  ///< of the views that are learned without picture and pose
  std::string prior = "prior";       ///< whose codes guide the views; empty: none
  double average_decay = 0.999;      ///< of the exponential moving average that is saved as the model
  bool resume = false;
  std::string device = "auto";
  std::uint64_t seed = 1;
  ViewCacheOptions views;
  /// What is learned is how objects look, not what cameras do to pictures: no colours, blur or errors of masks and crops.
  AugmentationOptions augmentation{.crop_shift = 0, .crop_scale = 0, .mask_error_share = 0, .blur_share = 0, .recolor_share = 0};
  void Check() const;
};

struct ViewsTrainingResult {
  std::int64_t steps = 0;
  double first_loss = 0, last_loss = 0;  ///< means of the first and the last 20 steps of this run
  bool interrupted = false;
  std::filesystem::path model;
};

/// Trains the small diffusion model: mean squared error of the target at uniformly drawn timesteps. Its guide is what the
/// views' cameras would see of the picture's code (CodeMaps).
/// @param config `guide_channels` follow from the prior
ViewsTrainingResult TrainViews(const ViewsTrainingOptions& options, const ViewDiffusionConfig& config, const ProgressCallback& progress = {});

/// Pictures [P, C, S, S] reduced to `side` pixels by means of pixels.
torch::Tensor Reduced(const torch::Tensor& pictures, std::int64_t side);

/// Peak signal-to-noise ratio, dB, of pictures in 0..1.
double PeakSignalToNoise(const torch::Tensor& picture, const torch::Tensor& truth);

}  // namespace antipode
