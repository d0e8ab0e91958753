#pragma once

#include <memory>

#include "antipode/evaluation/altered_photographs.h"

namespace antipode {

/// A data set with imprecise masks: each dilated once by a square of trunc(share min(width, height)) pixels of its picture (the
/// paper's test with 2, 5 and 10 percent).
class DilatedMasks : public AlteredPhotographs {
 public:
  /// @param share 0..0.5 @throws InvalidOption
  DilatedMasks(std::unique_ptr<Dataset> dataset, double share);
};

}  // namespace antipode
