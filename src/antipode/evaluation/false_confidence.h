#pragma once

#include <cstdint>
#include <vector>

#include "antipode/evaluation/evaluation.h"

namespace antipode {

struct FalseConfidenceOptions {
  int pairs = 200;         ///< in all, shared out evenly between neighbours in the data set
  std::uint64_t seed = 1;  ///< draws the views
  void Check() const;
};

/// Confidences of a method on pairs that show two different objects, where every pose is wrong.
struct FalseConfidence {
  std::vector<double> confidences;  ///< one a pair; 0 where the method found no pose
  int failures = 0;                 ///< pairs without a pose

  /// Percent of the pairs with a confidence above `limit`.
  double ShareAbove(double limit) const;
};

/// Each object's views are compared with views of the next one, those of the last with the first's.
/// @throws InvalidOption if the data set has fewer than two objects
FalseConfidence MeasureFalseConfidence(const Dataset& dataset, const PoseMethod& method,
                                       const FalseConfidenceOptions& options = {},
                                       const ProgressCallback& progress = {});

}  // namespace antipode
