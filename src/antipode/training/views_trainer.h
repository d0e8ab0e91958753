#pragma once

#include <filesystem>
#include <string>

#include "antipode/training/augmentation.h"
#include "antipode/training/training_run.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/progress.h"
#include "antipode/zero123/view_diffusion.h"

namespace antipode {

struct ViewsTrainingOptions {
  std::filesystem::path objects;  ///< folder or pack of .glb files
  std::filesystem::path cache;    ///< rendered views; empty: `run.out / "cache"`
  TrainingRunOptions run{.learning_rate = 2e-4};
  int objects_per_step = 4;
  int views_per_object = 5;       ///< the others are asked for, given the first one
  double unconditional_share = 0.1;  ///< of the views that are learned without picture and pose
  std::string prior = "prior";       ///< whose codes guide the views; empty: none
  std::string device = "auto";
  ViewCacheOptions views;
  /// What is learned is how objects look, not what cameras do to pictures: no colours, blur or errors of masks and crops.
  AugmentationOptions augmentation{.crop_shift = 0, .crop_scale = 0, .mask_error_share = 0, .blur_share = 0, .compression_share = 0,
                                   .cut_share = 0, .recolor_share = 0};
  void Check() const;
};

/// Trains the small diffusion model: mean squared error of the target at uniformly drawn timesteps. Its guide is what the
/// views' cameras would see of the picture's code (CodeMaps).
/// @param config `guide_channels` follow from the prior
TrainingResult TrainViews(const ViewsTrainingOptions& options, const ViewDiffusionConfig& config, const ProgressCallback& progress = {});

/// Pictures [P, C, S, S] reduced to `side` pixels by means of pixels.
torch::Tensor Reduced(const torch::Tensor& pictures, std::int64_t side);

/// Peak signal-to-noise ratio, dB, of pictures in 0..1.
double PeakSignalToNoise(const torch::Tensor& picture, const torch::Tensor& truth);

}  // namespace antipode
