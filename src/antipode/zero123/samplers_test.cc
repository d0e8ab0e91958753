#include "antipode/zero123/samplers.h"

#include <cmath>

#include <gtest/gtest.h>

#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kMean = 0.7, kDeviation = 0.4;

double VarianceAt(const DiffusionTime& time) {
  return time.alpha_bar * kDeviation * kDeviation + 1 - time.alpha_bar;
}

/// The exact noise prediction where all images are drawn from one normal distribution:
///   E[noise | x] = sqrt(1 - a) (x - sqrt(a) mean) / variance(a).
torch::Tensor ExactNoise(const torch::Tensor& x, const DiffusionTime& time) {
  return std::sqrt(1 - time.alpha_bar) * (x - std::sqrt(time.alpha_bar) * kMean) / VarianceAt(time);
}

NoisePredictor Exact() {
  return [](const torch::Tensor& x, const DiffusionTime& time, int) { return ExactNoise(x, time); };
}

/// Times at even distances in log SNR.
SamplerInput EvenInput(int steps) {
  SamplerInput input;
  const auto at = [&](double share) {
    const double log_snr = -2 + 5 * share;
    return DiffusionTime{0, 1 / (1 + std::exp(-2 * log_snr))};
  };
  for (int i = 0; i < steps; ++i) input.times.push_back(at(static_cast<double>(i) / steps));
  input.end = at(1);
  return input;
}

/// On the way from noise to image the standardised value stays what it was.
torch::Tensor ExactSolution(const torch::Tensor& noise, const SamplerInput& input) {
  const DiffusionTime& from = input.times.front();
  const auto standard = (noise - std::sqrt(from.alpha_bar) * kMean) / std::sqrt(VarianceAt(from));
  return std::sqrt(input.end.alpha_bar) * kMean + std::sqrt(VarianceAt(input.end)) * standard;
}

double ErrorWith(Solver solver, int steps) {
  const SamplerInput input = EvenInput(steps);
  const auto noise = torch::linspace(-2, 2, 9, torch::kDouble);
  return (Sample(solver, Exact(), noise, input) - ExactSolution(noise, input)).abs().max().item<double>();
}

/// The exponent p of error ~ 1 / steps^p.
double OrderOf(Solver solver) { return std::log2(ErrorWith(solver, 40) / ErrorWith(solver, 80)); }

TEST(Sample, DdimConvergesWithFirstOrder) { EXPECT_NEAR(OrderOf(Solver::kDdim), 1, 0.15); }

TEST(Sample, DpmSolverConvergesWithSecondOrder) { EXPECT_NEAR(OrderOf(Solver::kDpmSolverPlusPlus), 2, 0.3); }

TEST(Sample, UniPcConvergesWithSecondOrderOrBetter) { EXPECT_GT(OrderOf(Solver::kUniPc), 1.8); }

TEST(Sample, HigherOrdersNeedFewerSteps) {
  EXPECT_LT(ErrorWith(Solver::kDpmSolverPlusPlus, 10), 0.3 * ErrorWith(Solver::kDdim, 10));
  EXPECT_LT(ErrorWith(Solver::kUniPc, 10), 0.3 * ErrorWith(Solver::kDdim, 10));
}

TEST(Sample, StochasticDdimKeepsTheDistribution) {
  SamplerInput input = EvenInput(300);
  input.eta = 1;
  torch::manual_seed(1);
  const auto start = std::sqrt(VarianceAt(input.times.front())) * torch::randn({20000}, torch::kDouble) +
                     std::sqrt(input.times.front().alpha_bar) * kMean;
  const auto samples = Sample(Solver::kDdim, Exact(), start, input, [](int) { return torch::randn({20000}, torch::kDouble); });
  EXPECT_NEAR(samples.mean().item<double>(), std::sqrt(input.end.alpha_bar) * kMean, 0.02);
  EXPECT_NEAR(samples.var().item<double>() / VarianceAt(input.end), 1, 0.06);
}

TEST(Sample, AStepToTheEndWithoutNoiseGivesTheCleanImage) {
  SamplerInput input = EvenInput(5);
  input.end = {0, 1};
  for (const Solver solver : {Solver::kDpmSolverPlusPlus, Solver::kUniPc})
    EXPECT_TRUE(Sample(solver, Exact(), torch::zeros({3}, torch::kDouble), input).isfinite().all().item<bool>());
}

TEST(Sample, RefusesWhatMakesNoSense) {
  SamplerInput input = EvenInput(5);
  input.eta = 1;
  EXPECT_THROW(Sample(Solver::kUniPc, Exact(), torch::zeros({3}), input), InvalidOption);
  EXPECT_THROW(Sample(Solver::kDdim, Exact(), torch::zeros({3}), {}), InvalidOption);
  EXPECT_THROW(SolverFromName("euler"), InvalidOption);
}

TEST(NoiseSchedule, AsksAtThePublishedTimes) {
  const NoiseSchedule schedule;
  const struct { int steps, evaluations, first; } kTable[] = {{4, 3, 501}, {5, 4, 601}, {7, 7, 853}, {20, 19, 901}, {50, 49, 961}, {75, 76, 976}};
  for (const auto& row : kTable) {
    const auto times = schedule.PublishedTimes(row.steps);
    EXPECT_EQ(static_cast<int>(times.size()), row.evaluations) << row.steps;
    EXPECT_EQ(times.front().timestep, row.first) << row.steps;
    EXPECT_EQ(times.back().timestep, 1) << row.steps;
  }
  for (const int steps : {1, 0, 3, 9, 27, 36, 37, 105, 300, 501, 1000, 1001})
    EXPECT_THROW(schedule.PublishedTimes(steps), InvalidOption) << steps;
}

TEST(NoiseSchedule, EvenTimesStartAtTheLargest) {
  const NoiseSchedule schedule;
  for (const int steps : {1, 7, 1000}) {
    const auto times = schedule.EvenTimes(steps);
    EXPECT_EQ(static_cast<int>(times.size()), steps);
    EXPECT_EQ(times.front().timestep, 999);
    for (std::size_t i = 1; i < times.size(); ++i) EXPECT_LT(times[i].timestep, times[i - 1].timestep);
  }
}

}  // namespace
}  // namespace antipode
