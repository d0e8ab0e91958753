#include "antipode/zero123/samplers.h"

#include <cmath>

#include <ATen/CPUGeneratorImpl.h>

#include "antipode/util/error.h"
#include "antipode/util/quote.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

double SignalOf(const DiffusionTime& time) { return std::sqrt(time.alpha_bar); }
double NoiseOf(const DiffusionTime& time) { return std::sqrt(1 - time.alpha_bar); }
double LogSnr(const DiffusionTime& time) { return std::log(SignalOf(time) / NoiseOf(time)); }  // half of it

torch::Tensor CleanImage(const torch::Tensor& x, const torch::Tensor& noise, const DiffusionTime& time) {
  return (x - NoiseOf(time) * noise) / SignalOf(time);
}

DiffusionTime TimeAfter(const SamplerInput& input, std::size_t step) {
  return step + 1 < input.times.size() ? input.times[step + 1] : input.end;
}

torch::Tensor SampleByDdim(const NoisePredictor& predict, torch::Tensor x, const SamplerInput& input,
                           const NoiseSource& added, const Observation& observation) {
  for (std::size_t i = 0; i < input.times.size(); ++i) {
    const int step = static_cast<int>(i);
    const DiffusionTime& from = input.times[i];
    const DiffusionTime to = TimeAfter(input, i);
    const double deviation = DdimDeviation(from, to, input.eta);
    const auto noise = predict(x, from, step);
    const auto clean = CleanImage(x, noise, from);
    x = SignalOf(to) * clean + std::sqrt(1 - to.alpha_bar - deviation * deviation) * noise;
    if (deviation > 0) x = x + deviation * added(step);
    observation.Show("step" + std::to_string(i) + ".pred_x0", clean);
    observation.Show("step" + std::to_string(i) + ".x_prev", x);
  }
  return x;
}

/// x_t of an exponential integrator on the clean image: (noise_t / noise_s) x_s - signal_t expm1(-h) `clean`.
torch::Tensor Integrate(const torch::Tensor& x, const torch::Tensor& clean, const DiffusionTime& from,
                        const DiffusionTime& to) {
  const double h = LogSnr(to) - LogSnr(from);
  return NoiseOf(to) / NoiseOf(from) * x - SignalOf(to) * std::expm1(-h) * clean;
}

/// A step may end without noise: the integral over infinite log SNR leaves the clean image.
bool EndsClean(const DiffusionTime& to) { return to.alpha_bar >= 1; }

/// m_0 + D / 2, D = (m_0 - m_1) / r, r = h_1 / h: the clean image in the middle of the step.
torch::Tensor Extrapolated(const torch::Tensor& clean, const torch::Tensor& before, double h, double h_before) {
  return clean + (clean - before) * (0.5 * h / h_before);
}

torch::Tensor SampleByDpmSolver(const NoisePredictor& predict, torch::Tensor x, const SamplerInput& input) {
  torch::Tensor before;
  double h_before = 0;
  for (std::size_t i = 0; i < input.times.size(); ++i) {
    const DiffusionTime& from = input.times[i];
    const DiffusionTime to = TimeAfter(input, i);
    const auto clean = CleanImage(x, predict(x, from, static_cast<int>(i)), from);
    if (EndsClean(to)) return clean;
    const double h = LogSnr(to) - LogSnr(from);
    x = Integrate(x, before.defined() ? Extrapolated(clean, before, h, h_before) : clean, from, to);
    before = clean;
    h_before = h;
  }
  return x;
}

/// The corrector's weights of D_1 = (m_1 - m_0) / r_1 (the step before, r_1 = -h_1 / h) and D_2 = m_2 - m_0 (the
/// predicted point), from which the integral of a parabola through all three is exact:
///   w_1 + w_2 = b_1,  r_1 w_1 + w_2 = b_2,  b_1 = phi_2 / phi_1,  b_2 = 2 phi_3 / phi_1,
///   phi_1 = expm1(-h), phi_2 = phi_1 / -h - 1, phi_3 = phi_2 / -h - 1/2.
struct CorrectorWeights {
  double before = 0, predicted = 0;
};

CorrectorWeights WeightsOf(double h, double h_before) {
  const double phi1 = std::expm1(-h), phi2 = phi1 / -h - 1, phi3 = phi2 / -h - 0.5;
  const double b1 = phi2 / phi1, b2 = 2 * phi3 / phi1;
  if (h_before == 0) return {0, b1};
  const double r1 = -h_before / h;
  const double before = (b2 - b1) / (r1 - 1);
  return {before, b1 - before};
}

torch::Tensor SampleByUniPc(const NoisePredictor& predict, torch::Tensor x, const SamplerInput& input) {
  torch::Tensor before;
  double h_before = 0;
  auto clean = CleanImage(x, predict(x, input.times.front(), 0), input.times.front());
  for (std::size_t i = 0; i < input.times.size(); ++i) {
    const DiffusionTime& from = input.times[i];
    const DiffusionTime to = TimeAfter(input, i);
    if (EndsClean(to)) return clean;
    const double h = LogSnr(to) - LogSnr(from);
    const auto predicted = Integrate(x, before.defined() ? Extrapolated(clean, before, h, h_before) : clean, from, to);
    if (i + 1 == input.times.size()) return predicted;
    const auto clean_there = CleanImage(predicted, predict(predicted, to, static_cast<int>(i) + 1), to);
    const CorrectorWeights weights = WeightsOf(h, h_before);
    auto slope = weights.predicted * (clean_there - clean);
    if (before.defined()) slope = slope + weights.before * (clean - before) * (h / h_before);
    x = Integrate(x, clean + slope, from, to);
    before = clean;
    clean = clean_there;
    h_before = h;
  }
  return x;
}

}  // namespace

Solver SolverFromName(const std::string& name) {
  for (const Solver solver : {Solver::kDdim, Solver::kDpmSolverPlusPlus, Solver::kUniPc})
    if (NameOf(solver) == name) return solver;
  throw InvalidOption("solver", Quoted(name) + " is unknown", "use ddim, dpm++ or unipc");
}

std::string NameOf(Solver solver) {
  switch (solver) {
    case Solver::kDdim: return "ddim";
    case Solver::kDpmSolverPlusPlus: return "dpm++";
    case Solver::kUniPc: break;
  }
  return "unipc";
}

torch::Tensor Sample(Solver solver, const NoisePredictor& predict, torch::Tensor noise, const SamplerInput& input,
                     const NoiseSource& added, const Observation& observation) {
  if (input.times.empty()) throw InvalidOption("steps", "is 0", "use a positive number");
  if (solver != Solver::kDdim && input.eta != 0)
    throw InvalidOption("eta", "only means something to ddim", "use eta 0, or solver ddim");
  switch (solver) {
    case Solver::kDdim: return SampleByDdim(predict, std::move(noise), input, added, observation);
    case Solver::kDpmSolverPlusPlus: return SampleByDpmSolver(predict, std::move(noise), input);
    case Solver::kUniPc: break;
  }
  return SampleByUniPc(predict, std::move(noise), input);
}

torch::Tensor Guided(const torch::Tensor& unconditional, const torch::Tensor& conditional, double scale) {
  return unconditional + scale * (conditional - unconditional);
}

torch::Tensor ViewNoise(std::uint64_t seed, const std::string& view, int step, at::IntArrayRef shape) {
  const std::uint64_t of_view = CombineSeeds(seed, HashOfName(view));
  auto generator = at::make_generator<at::CPUGeneratorImpl>(CombineSeeds(of_view, static_cast<std::uint64_t>(step)));
  return at::randn(shape, generator, torch::kFloat);
}

}  // namespace antipode
