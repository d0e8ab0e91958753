#include "antipode/zero123/noise_schedule.h"

#include <cmath>
#include <string>

#include "antipode/util/error.h"

namespace antipode {

NoiseSchedule::NoiseSchedule() {
  const double first = std::sqrt(0.00085), last = std::sqrt(0.012);
  double product = 1;
  for (int i = 0; i < kTrainingSteps; ++i) {
    const double root = first + (last - first) * i / (kTrainingSteps - 1);
    betas_.push_back(root * root);
    product *= 1 - betas_.back();
    alpha_bars_.push_back(static_cast<float>(product));
  }
}

DiffusionTime NoiseSchedule::At(int timestep) const {
  return {static_cast<double>(timestep), alpha_bars_.at(static_cast<std::size_t>(timestep))};
}

std::vector<int> NoiseSchedule::PublishedTable(int steps) const {
  if (steps < 1 || steps > kTrainingSteps)
    throw InvalidOption("steps", "is " + std::to_string(steps), "use 2 to 1000");
  const int stride = kTrainingSteps / steps;
  std::vector<int> table;
  for (int i = 0; i < kTrainingSteps; i += stride) table.push_back(i + 1);
  if (table.back() == kTrainingSteps)
    throw InvalidOption("steps", "of " + std::to_string(steps) + " would need timestep 1000, which does not exist",
                        "use " + std::to_string(steps + 1) + " or another number");
  return table;
}

std::vector<DiffusionTime> NoiseSchedule::PublishedTimes(int steps) const {
  const std::vector<int> table = PublishedTable(steps);
  if (table.size() < 2) throw InvalidOption("steps", "of 1 would not denoise at all", "use at least 2");
  std::vector<DiffusionTime> times;
  for (std::size_t i = table.size() - 1; i-- > 0;) times.push_back(At(table[i]));
  return times;
}

std::vector<DiffusionTime> NoiseSchedule::EvenTimes(int steps) const {
  if (steps < 1 || steps > kTrainingSteps)
    throw InvalidOption("steps", "is " + std::to_string(steps), "use 1 to 1000");
  std::vector<DiffusionTime> times;
  for (int i = 0; i < steps; ++i)
    times.push_back(At(static_cast<int>(std::lround(kTrainingSteps * (1 - static_cast<double>(i) / steps))) - 1));
  return times;
}

double DdimDeviation(const DiffusionTime& from, const DiffusionTime& to, double eta) {
  return eta * std::sqrt((1 - to.alpha_bar) / (1 - from.alpha_bar) * (1 - from.alpha_bar / to.alpha_bar));
}

}  // namespace antipode
