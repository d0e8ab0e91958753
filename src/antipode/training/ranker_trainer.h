#pragma once

#include <filesystem>
#include <string>

#include "antipode/prior/mode_ranker.h"
#include "antipode/training/augmentation.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/progress.h"

namespace antipode {

struct RankerTrainingOptions {
  std::filesystem::path objects;             ///< folder or pack of .glb files to train on
  std::filesystem::path validation_objects;  ///< folder or pack to calibrate and measure on; may be empty
  std::filesystem::path out;                 ///< folder for the model prior/ and log.csv
  std::filesystem::path cache;               ///< rendered views; empty: `out / "cache"`
  std::string prior = "prior";               ///< the trained first stage
  double minutes = 45;                       ///< time budget after encoding
  int iterations = 0;                        ///< if positive, the budget instead of `minutes`
  int threads = 0;                           ///< 0: as many as processors
  int groups = 7000;                         ///< groups of views that are encoded
  int views_per_group = 8;
  int batch = 48;                            ///< pairs a step
  int modes = 8;                             ///< hypotheses of a pair
  double rotation_noise_deg = 5;             ///< of the hypotheses
  double learning_rate = 1e-3;
  double weight_decay = 1e-2;
  std::uint64_t seed = 1;
  ModeRankerConfig ranker;
  AugmentationOptions augmentation;
  /// Variants that the first stage has not been trained on: on known objects it hardly errs.
  ViewCacheOptions views{.views_per_object = 10, .variants = 14, .seed = 2};
  void Check() const;
};

struct RankerTrainingResult {
  std::int64_t steps = 0;
  double first_loss = 0, last_loss = 0;  ///< means of the first and the last 200 steps
  std::filesystem::path model;           ///< the whole prior: first stage, second stage, calibration
};

/// Trains the prior's second stage on the modes of its first one. The codes of augmented views are computed once; every
/// step compares pairs of views of one object. A pair's modes are the maxima of the correlation on a grid of rotations,
/// 30 degrees apart; the target weighs them by exp(-(error / 10 degrees)^2 / 2), and pairs without the truth (all errors
/// above 30 degrees) are left out. The loss is the cross-entropy of the log weights added to the first stage's scores,
/// whose weight is learned, and half of that of the log weights alone.
RankerTrainingResult TrainRanker(const RankerTrainingOptions& options, const ProgressCallback& progress = {});

}  // namespace antipode
