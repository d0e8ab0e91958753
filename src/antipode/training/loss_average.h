#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "antipode/util/error.h"

namespace antipode {

/// Means of the losses of a run's first and last steps.
class LossAverage {
 public:
  explicit LossAverage(int steps) : steps_(steps) {}

  /// @throws Error if the loss is not finite
  void Add(double loss) {
    if (!std::isfinite(loss)) throw Error("training", "the loss is not finite", "use a lower --learning-rate");
    ++count_;
    last_ += (loss - last_) / static_cast<double>(std::min(steps_, count_));
    if (count_ <= steps_) first_ = last_;
  }

  double first() const { return first_; }
  double last() const { return last_; }

 private:
  std::int64_t steps_, count_ = 0;
  double first_ = 0, last_ = 0;
};

}  // namespace antipode
