#pragma once

#include <cstdint>
#include <vector>

namespace antipode {

/// One moment of the diffusion: x = sqrt(alpha_bar) x_0 + sqrt(1 - alpha_bar) noise.
struct DiffusionTime {
  double timestep = 0;  ///< as the network takes it
  double alpha_bar = 1;
};

/// beta_i = (sqrt(0.00085) + (sqrt(0.012) - sqrt(0.00085)) i / 999)^2, alpha_bar_i = prod_{j <= i} (1 - beta_j), in
/// double, alpha_bar then rounded to float32 as in the published sampler.
class NoiseSchedule {
 public:
  static constexpr int kTrainingSteps = 1000;

  NoiseSchedule();

  const std::vector<double>& betas() const { return betas_; }
  const std::vector<double>& alpha_bars() const { return alpha_bars_; }

  DiffusionTime At(int timestep) const;

  /// Largest first, all that the sampler evaluates: {0, c, 2c, ..} + 1 with c = floor(1000 / steps), without the
  /// largest, as the program of the paper does: 50 steps are 49 evaluations.
  /// @throws InvalidOption for step counts whose table would end at timestep 1000 (stride 1, 3, 9, 27, 37, 111 or
  ///   333), or without any evaluation
  std::vector<DiffusionTime> PublishedTimes(int steps) const;
  /// The whole table that PublishedTimes is cut from, smallest first.
  std::vector<int> PublishedTable(int steps) const;

  /// `steps` evaluations at even distances, the first at timestep 999, largest first.
  std::vector<DiffusionTime> EvenTimes(int steps) const;

 private:
  std::vector<double> betas_, alpha_bars_;
};

/// Standard deviation of the noise that a step of DDIM adds (Song et al., ICLR 2021, eq. 16):
///   eta sqrt((1 - b) / (1 - a) (1 - a / b)),  a = from.alpha_bar, b = to.alpha_bar.
double DdimDeviation(const DiffusionTime& from, const DiffusionTime& to, double eta);

}  // namespace antipode
