#pragma once

#include <filesystem>
#include <string>

#include "antipode/prior/mode_ranker.h"
#include "antipode/training/augmentation.h"
#include "antipode/training/training_run.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/progress.h"

namespace antipode {

struct RankerTrainingOptions {
  std::filesystem::path objects;             ///< folder or pack of .glb files to train on
  std::filesystem::path validation_objects;  ///< folder or pack to calibrate and measure on; may be empty
  std::filesystem::path cache;               ///< rendered views; empty: `run.out / "cache"`
  std::string prior = "prior";               ///< the trained first stage
  /// Its time budget counts from where the views are encoded.
  TrainingRunOptions run{.minutes = 45, .warm_up_steps = 200, .average_decay = 0.998, .averaged_losses = 200};
  int threads = 0;                           ///< 0: as many as processors
  int groups = 7000;                         ///< groups of views that are encoded
  int views_per_group = 8;
  int batch = 48;                            ///< pairs a step
  int modes = 8;                             ///< hypotheses of a pair
  double rotation_noise_deg = 5;             ///< of the hypotheses
  double weight_decay = 1e-2;
  ModeRankerConfig ranker;
  AugmentationOptions augmentation;
  /// Variants that the first stage has not been trained on: on known objects it hardly errs.
  ViewCacheOptions views{.views_per_object = 10, .variants = 14, .seed = 2};
  void Check() const;
};

/// The model is the whole prior: first stage, second stage, calibration.
struct RankerTrainingResult : TrainingResult {
  double share_right = 0;  ///< of pairs for which both stages choose the best hypothesis, mean of the last steps
};

/// Trains the prior's second stage on the modes of its first one. The codes of augmented views are computed once; every
/// step compares pairs of views of one object. A pair's modes are the maxima of the correlation on a grid of rotations,
/// 30 degrees apart; the target weighs them by exp(-(error / 10 degrees)^2 / 2), and pairs without the truth (all errors
/// above 30 degrees) are left out. The loss is the cross-entropy of the log weights added to the first stage's scores,
/// whose weight is learned, and half of that of the log weights alone.
RankerTrainingResult TrainRanker(const RankerTrainingOptions& options, const ProgressCallback& progress = {});

}  // namespace antipode
