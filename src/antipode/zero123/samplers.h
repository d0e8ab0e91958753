#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <torch/torch.h>

#include "antipode/nn/observation.h"
#include "antipode/zero123/noise_schedule.h"

namespace antipode {

enum class Solver {
  kDdim,           ///< Song et al., ICLR 2021; stochastic if eta > 0
  kDpmSolverPlusPlus,  ///< DPM-Solver++(2M), Lu et al., 2022
  kUniPc,          ///< UniPC of order 2 with corrector, Zhao et al., NeurIPS 2023
};

/// "ddim", "dpm++", "unipc". @throws InvalidOption for another name
Solver SolverFromName(const std::string& name);
std::string NameOf(Solver solver);

/// Predicts the noise in x at a time. `step` counts evaluations from 0.
using NoisePredictor = std::function<torch::Tensor(const torch::Tensor& x, const DiffusionTime& time, int step)>;

/// Draws the noise that step `step` adds, of the shape of x.
using NoiseSource = std::function<torch::Tensor(int step)>;

/// Integrates from pure noise to an image.
/// @param noise x at times.front(), unit normal
/// @param times where the predictor is asked, largest timestep first
/// @param end where the last step arrives
/// @param eta of DDIM; 0 for the others
/// @param added asked once a step if eta > 0
/// @param observation sees "step<k>.pred_x0" and "step<k>.x_prev" of DDIM
/// @throws InvalidOption if there are no times, or eta is not 0 for a solver other than DDIM
struct SamplerInput {
  std::vector<DiffusionTime> times;
  DiffusionTime end;
  double eta = 0;
};
torch::Tensor Sample(Solver solver, const NoisePredictor& predict, torch::Tensor noise, const SamplerInput& input,
                     const NoiseSource& added = {}, const Observation& observation = {});

/// Classifier-free guidance: u + scale (c - u).
torch::Tensor Guided(const torch::Tensor& unconditional, const torch::Tensor& conditional, double scale);

/// Unit normal noise of one view, which depends on the seed, the view's identity and the step only, not on the batch it is
/// drawn in. Step -1 is the start.
/// @return [C, H, W]
torch::Tensor ViewNoise(std::uint64_t seed, const std::string& view, int step, at::IntArrayRef shape);

}  // namespace antipode
