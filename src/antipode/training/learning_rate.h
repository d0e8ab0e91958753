#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <torch/torch.h>

namespace antipode {

/// Share of the highest learning rate: rises from 0 to 1 in the first `warm_up_steps`, and falls as half a cosine from 1 to
/// `least` while the budget is used up.
/// @param fraction of the budget that is used up; beyond 1 as at 1
inline double LearningRateFactor(std::int64_t step, int warm_up_steps, double fraction, double least = 0.02) {
  const double warm_up = warm_up_steps > 0 ? std::min(1.0, static_cast<double>(step + 1) / warm_up_steps) : 1;
  return warm_up * (least + (1 - least) * 0.5 * (1 + std::cos(std::numbers::pi * std::min(1.0, fraction))));
}

inline void SetLearningRate(torch::optim::AdamW& optimizer, double rate, std::size_t group = 0) {
  static_cast<torch::optim::AdamWOptions&>(optimizer.param_groups().at(group).options()).lr(rate);
}

}  // namespace antipode
