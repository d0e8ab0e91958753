#pragma once

#include <filesystem>
#include <string>

#include "antipode/training/matching_pairs.h"
#include "antipode/training/training_run.h"
#include "antipode/util/progress.h"

namespace antipode {

struct MatcherTrainingOptions {
  std::filesystem::path objects;  ///< folder or pack of .glb files
  std::string start = "xfeat-lighterglue";  ///< the model that training starts from
  TrainingRunOptions run{.minutes = 90, .learning_rate = 3e-4, .warm_up_steps = 50, .average_decay = 0.995, .averaged_losses = 50};
  int features = 1024;            ///< of a picture, the best ones
  int points = 512;               ///< drawn of them for every pair
  int variants = 4;               ///< of an object, see RandomVariant
  double stretch = 1.3;
  MatchingPairOptions pairs;
  void Check() const;
};

/// Trains LighterGlue on rendered objects seen from far apart, where the published weights, made for scenes, find little. XFeat
/// stays as it is. Every step renders another object (RenderMatchingPairs). The loss of a pair is that of LightGlue (Lindenberger
/// et al., ICCV 2023, eq. 12): with the true matches M and the lonely features A, B of both pictures, for every layer
///   -1 / |M| sum_M log P_ij - 1 / (2 |A|) sum_A log(1 - s_i) - 1 / (2 |B|) sum_B log(1 - s_j),
/// s the probability of having a match; all layers but the last count a tenth.
///
/// A step's random numbers depend on the seed and the step alone.
TrainingResult TrainMatcher(const MatcherTrainingOptions& options, const ProgressCallback& progress = {});

}  // namespace antipode
