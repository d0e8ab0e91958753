#pragma once

#include "antipode/util/error.h"
#include "antipode/util/progress.h"

namespace antipode {

/// Breaks a training off at the report of a step, before its checkpoint is written.
inline ProgressCallback StopAtStep(int step) {
  return [step, reported = 0](const Progress& progress) mutable {
    if (progress.stage.starts_with("training") && ++reported == step) throw Interrupted("test", "stops");
  };
}

}  // namespace antipode
