#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "antipode/prior/object_encoder.h"
#include "antipode/training/augmentation.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/progress.h"

namespace antipode {

struct PriorTrainingOptions {
  std::filesystem::path objects;             ///< folder or pack of .glb files to train on (MeshCollection)
  std::filesystem::path validation_objects;  ///< folder or pack to measure on; may be empty
  std::filesystem::path out;                 ///< checkpoint, log, model
  std::filesystem::path cache;               ///< rendered views; empty: `out / "cache"`
  /// Model to start from: an ImageNet backbone, below random weights, or a prior whose encoder has the shape of `encoder`.
  std::string start = "efficientnet-lite0";

  double minutes = 60;     ///< time budget, counted over all resumed runs
  int iterations = 0;      ///< if positive, the budget instead of `minutes`: runs become reproducible
  std::uint64_t seed = 1;
  std::string device = "auto";
  int threads = 0;         ///< 0: as many as processors

  int objects_per_step = 8;
  int views_per_object = 8;
  int frozen_batches = 120;         ///< batches whose backbone features are cached for the first stage
  int frozen_epochs = 3;            ///< passes over them with the backbone frozen
  int frozen_blocks = 3;            ///< first blocks of the backbone that are never trained
  double learning_rate = 1e-3;
  double backbone_learning_rate = 4e-4;  ///< 0 leaves the backbone as it is
  double weight_decay = 0.02;
  int warm_up_steps = 150;
  double gradient_clip = 1.0;
  double average_decay = 0.998;     ///< of the exponential moving average that is evaluated and shipped
  int grid_size = 4096;             ///< rotations that stand for SO(3) in the loss
  double minutes_between_checkpoints = 5;
  double minutes_between_validations = 10;

  ObjectEncoderConfig encoder;
  EncoderDropout dropout{.branches = 0, .tokens = 0.05};
  AugmentationOptions augmentation;
  ViewCacheOptions views;
  void Check() const;
};

struct PriorTrainingResult {
  std::int64_t steps = 0;
  double minutes = 0;
  double loss = 0;                ///< mean of the last 50 steps
  bool interrupted = false;       ///< stopped by Ctrl-C; resume goes on from here
  std::filesystem::path model;    ///< folder with model.safetensors, model.json, card.md
};

enum class StartFrom {
  kScratch,     ///< random weights everywhere
  kModel,       ///< `start`
  kCheckpoint,  ///< `out / "checkpoint.safetensors"`
};

/// Trains the object prior end to end: first, unless it starts from a prior, the head on cached features of the frozen backbone,
/// then all of it. Every step shows `objects_per_step` objects in `views_per_object` views each; every pair
/// of views of one object is supervision (`NegativeLogDensity`).
///
/// Writes to `out`: `checkpoint.safetensors` (weights, moving average, optimiser, counters; atomically),
/// `log.csv` (step, minutes, loss, learning rate, validation), and at every validation and the end `prior/`,
/// a model folder in fp16, calibrated on the validation objects if there are any.
/// With `resume`, continues from the checkpoint; the random numbers of a step depend on the seed and the
/// step alone, so a resumed run with `iterations` gives the same weights as an uninterrupted one.
PriorTrainingResult TrainPrior(const PriorTrainingOptions& options, StartFrom start,
                               const ProgressCallback& progress);

}  // namespace antipode
