#pragma once

#include <filesystem>
#include <string>

#include "antipode/gen6d/refiner.h"
#include "antipode/gen6d/selector.h"
#include "antipode/training/posed_objects.h"
#include "antipode/training/training_run.h"

namespace antipode {

/// Training of Gen6D's networks on rendered objects on white, as the route `diffusion` sees them (Liu et al., "Gen6D",
/// ECCV 2022; the losses are in gen6d/losses.h). The backbone stays as it is: that of a trained prior, or VGG-11.
struct ViewComparisonTrainingOptions {
  std::filesystem::path objects;   ///< folder or pack of .glb files
  std::string backbone_model = "prior";  ///< whose backbone the built-in networks share
  TrainingRunOptions run{.learning_rate = 5e-4, .warm_up_steps = 200, .average_decay = 0.995, .averaged_losses = 100};
  int batch = 8;                   ///< queries a step; the refiner's are of one group, see QueryGroup
  int views = 24;                  ///< references that the selector chooses from
  double weight_decay = 1e-3;
  PosedObjectOptions rendering;
  void Check() const;
};

struct ViewComparisonTrainingResult : TrainingResult {
  double uninformed_loss = 0;  ///< of a network that says nothing, mean of the last steps
};

/// The built-in shape: with EfficientNet-Lite0, about a million parameters beside the shared backbone.
SelectorConfig BuiltInSelector();
RefinerConfig BuiltInRefiner();

ViewComparisonTrainingResult TrainSelector(const ViewComparisonTrainingOptions& options, const SelectorConfig& config,
                                           const ProgressCallback& progress = {});
ViewComparisonTrainingResult TrainRefiner(const ViewComparisonTrainingOptions& options, const RefinerConfig& config,
                                          const ProgressCallback& progress = {});

}  // namespace antipode
