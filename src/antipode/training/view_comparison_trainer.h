#pragma once

#include <filesystem>
#include <string>

#include "antipode/gen6d/refiner.h"
#include "antipode/gen6d/selector.h"
#include "antipode/training/posed_objects.h"

namespace antipode {

/// Training of Gen6D's networks on rendered objects on white, as the route `diffusion` sees them (Liu et al., "Gen6D",
/// ECCV 2022; the losses are in gen6d/losses.h). The backbone stays as it is: that of a trained prior, or VGG-11.
struct ViewComparisonTrainingOptions {
  std::filesystem::path objects;   ///< folder or pack of .glb files
  std::filesystem::path out;       ///< folder for the model and log.csv
  std::string backbone_model = "prior";  ///< whose backbone the built-in networks share
  double minutes = 60;
  int iterations = 0;              ///< if positive, the budget instead of `minutes`
  int batch = 8;                   ///< queries a step; the refiner's are of one group, see QueryGroup
  int views = 24;                  ///< references that the selector chooses from
  double learning_rate = 5e-4;
  double weight_decay = 1e-3;
  double gradient_clip = 1.0;
  bool resume = false;             ///< go on from the weights in `out`
  std::uint64_t seed = 1;
  PosedObjectOptions rendering;
  void Check() const;
};

struct ViewComparisonTrainingResult {
  std::int64_t steps = 0;
  double first_loss = 0, last_loss = 0;  ///< means of the first and the last 100 steps
  double uninformed_loss = 0;            ///< of a network that says nothing, in the last 100 steps
  std::filesystem::path model;
};

/// The built-in shape: with EfficientNet-Lite0, about a million parameters beside the shared backbone.
SelectorConfig BuiltInSelector();
RefinerConfig BuiltInRefiner();

ViewComparisonTrainingResult TrainSelector(const ViewComparisonTrainingOptions& options, const SelectorConfig& config,
                                           const ProgressCallback& progress = {});
ViewComparisonTrainingResult TrainRefiner(const ViewComparisonTrainingOptions& options, const RefinerConfig& config,
                                          const ProgressCallback& progress = {});

}  // namespace antipode
