#pragma once

#include <filesystem>
#include <string>

#include "antipode/prior/object_prior.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/progress.h"

namespace antipode {

struct UprightTrainingOptions {
  std::filesystem::path objects;   ///< folder or pack of .glb files that stand upright, +Y up
  std::filesystem::path out;       ///< folder for the model upright/
  std::filesystem::path cache;     ///< rendered views; empty: `out / "cache"`
  int views_per_variant = 4;       ///< codes of each object variant, differently augmented
  int hidden = 96;
  int steps = 1500;
  int batch = 256;
  double learning_rate = 1e-3;
  double weight_decay = 0.1;
  double noise = 0.3;              ///< added to the codes, in their standard deviations
  double dropout = 0.2;
  std::uint64_t seed = 1;
  ViewCacheOptions views;
  void Check() const;
};

struct UprightTrainingResult {
  double loss = 0;  ///< mean of the last 100 steps
  std::filesystem::path model;
};

/// Trains `UprightReadout` on the codes of a trained prior; minutes.
/// @param prior_sha256 of the prior's weights: the readout means nothing to another one
UprightTrainingResult TrainUpright(const UprightTrainingOptions& options, const ObjectPrior& prior, const std::string& prior_sha256,
                                   const ProgressCallback& progress = {});

}  // namespace antipode
