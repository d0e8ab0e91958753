#include "antipode/prior/posterior.h"

#include <random>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kDegree = 6;
constexpr int kChannels = 12;

using Code = Eigen::MatrixXd;  // [channels, (L + 1)^2]

const RotationPosterior& Posterior() {
  static const RotationPosterior posterior(kDegree, 8192);
  return posterior;
}

Code RandomCode(std::mt19937_64& random, double norm = 5) {
  std::normal_distribution<double> normal;
  Code code(kChannels, (kDegree + 1) * (kDegree + 1));
  for (double& value : code.reshaped()) value = normal(random);
  return code * (norm / code.norm());
}

/// The ideal code of the object turned by `rotation`: D(R) F.
Code Turned(const Code& code, const Eigen::Matrix3d& rotation) {
  const Eigen::VectorXd wigner = WignerMatrices(rotation, kDegree);
  Code turned(code.rows(), code.cols());
  for (int l = 0; l <= kDegree; ++l)
    turned.middleCols(l * l, 2 * l + 1) =
        code.middleCols(l * l, 2 * l + 1) * WignerBlock(wigner, l).transpose();
  return turned;
}

Eigen::VectorXf Correlate(const Code& query, const Code& reference) {
  Eigen::VectorXf stacked(WignerSize(kDegree));
  for (int l = 0; l <= kDegree; ++l) {
    const Eigen::MatrixXd block = query.middleCols(l * l, 2 * l + 1).transpose() *
                                  reference.middleCols(l * l, 2 * l + 1);
    for (int m = 0; m < 2 * l + 1; ++m)
      for (int n = 0; n < 2 * l + 1; ++n)
        stacked[WignerOffset(l) + m * (2 * l + 1) + n] = static_cast<float>(block(m, n));
  }
  return stacked;
}

TEST(RotationPosterior, FindsTheRotationOfAnIdealCode) {
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const Code code = RandomCode(random);
    const Eigen::Matrix3d rotation = RandomRotation(random);
    const auto modes = Posterior().FindModes(Correlate(Turned(code, rotation), code));
    EXPECT_LT(AngleBetweenDeg(modes.front().rotation, rotation), 0.01);
    EXPECT_GT(modes.front().probability, 0.5);
  }
}

TEST(RotationPosterior, SwappingTheImagesInvertsEveryMode) {
  std::mt19937_64 random(2);
  for (int trial = 0; trial < 10; ++trial) {
    const Code a = RandomCode(random), b = RandomCode(random);
    const auto forward = Posterior().FindModes(Correlate(b, a));
    const auto backward = Posterior().FindModes(Correlate(a, b));
    ASSERT_EQ(forward.size(), backward.size());
    for (std::size_t k = 0; k < forward.size(); ++k) {
      EXPECT_LT(AngleBetweenDeg(forward[k].rotation, backward[k].rotation.transpose()), 0.01);
      EXPECT_NEAR(forward[k].score, backward[k].score, 1e-3);
      EXPECT_NEAR(forward[k].probability, backward[k].probability, 1e-3);
    }
  }
}

TEST(RotationPosterior, TurningTheQueryTurnsTheModes) {
  std::mt19937_64 random(3);
  const Code code = RandomCode(random);
  const Eigen::Matrix3d first = RandomRotation(random), second = RandomRotation(random);
  const auto modes = Posterior().FindModes(Correlate(Turned(Turned(code, first), second), code));
  EXPECT_LT(AngleBetweenDeg(modes.front().rotation, second * first), 0.01);
}

TEST(RotationPosterior, SymmetricObjectsHaveSeveralModes) {
  std::mt19937_64 random(4);
  const Eigen::Matrix3d half_turn = RotationAboutY(std::numbers::pi);
  const Code one = RandomCode(random, 2);
  const Code symmetric = one + Turned(one, half_turn);
  const Eigen::Matrix3d rotation = RandomRotation(random);
  const auto modes = Posterior().FindModes(Correlate(Turned(symmetric, rotation), symmetric));
  ASSERT_GE(modes.size(), 2u);
  const auto nearest = [&](const Eigen::Matrix3d& target) {
    return std::min(AngleBetweenDeg(modes[0].rotation, target), AngleBetweenDeg(modes[1].rotation, target));
  };
  EXPECT_LT(nearest(rotation), 0.1);
  EXPECT_LT(nearest(rotation * half_turn), 0.1);
  EXPECT_NEAR(modes[0].probability, modes[1].probability, 0.1);
}

TEST(RotationPosterior, ProbabilitiesSumToAtMostOneAndModesAreApart) {
  std::mt19937_64 random(5);
  for (int trial = 0; trial < 10; ++trial) {
    const auto modes = Posterior().FindModes(Correlate(RandomCode(random, 3), RandomCode(random, 3)),
                                             {.max_modes = 10, .least_probability = 0});
    double sum = 0;
    for (std::size_t i = 0; i < modes.size(); ++i) {
      sum += modes[i].probability;
      if (i > 0) {
        EXPECT_LE(modes[i].probability, modes[i - 1].probability);
      }
      for (std::size_t j = 0; j < i; ++j)
        EXPECT_GT(AngleBetweenDeg(modes[i].rotation, modes[j].rotation), 30 - 1e-6);
    }
    EXPECT_LE(sum, 1 + 1e-9);
  }
}

TEST(RotationPosterior, MaximizeReachesAStationaryPoint) {
  std::mt19937_64 random(6);
  const Eigen::VectorXf correlation = Correlate(RandomCode(random), RandomCode(random));
  const Eigen::Matrix3d start = RandomRotation(random);
  const Eigen::Matrix3d peak = Posterior().Maximize(correlation, start);
  const double best = Posterior().Score(correlation, peak);
  EXPECT_GE(best, Posterior().Score(correlation, start));
  for (int axis = 0; axis < 3; ++axis) {
    for (const double step : {-0.01, 0.01}) {
      const Eigen::Matrix3d beside = RotationFromVector(step * Eigen::Vector3d::Unit(axis)) * peak;
      EXPECT_LE(Posterior().Score(correlation, beside), best + 1e-9);
    }
  }
}

TEST(RotationPosterior, ATemperatureFlattens) {
  std::mt19937_64 random(7);
  const Code code = RandomCode(random, 4);
  const Eigen::VectorXf correlation = Correlate(code, code);
  const auto sharp = Posterior().FindModes(correlation, {.temperature = 0.5});
  const auto flat = Posterior().FindModes(correlation, {.temperature = 3});
  EXPECT_GT(sharp.front().probability, flat.front().probability);
}

TEST(RotationPosterior, TheMassAroundAPeakIsItsProbability) {
  std::mt19937_64 random(8);
  const Eigen::VectorXf correlation = Correlate(RandomCode(random, 2), RandomCode(random, 2));
  const auto modes = Posterior().FindModes(correlation);
  const GridPosterior on_grid = Posterior().OnGrid(correlation);
  EXPECT_NEAR(on_grid.weights.sum(), 1, 1e-9);
  EXPECT_NEAR(on_grid.MassAround(modes.front().rotation), modes.front().probability, 1e-9);
  EXPECT_NEAR(on_grid.MassAround(RandomRotation(random), 179.9), 1, 2e-3);
}

TEST(Logistic, InvertsLogOdds) {
  for (const double probability : {0.001, 0.2, 0.5, 0.97}) EXPECT_NEAR(Logistic(LogOdds(probability)), probability, 1e-12);
}

TEST(RotationPosterior, RefusesImpossibleOptions) {
  const Eigen::VectorXf correlation = Eigen::VectorXf::Zero(WignerSize(kDegree));
  EXPECT_THROW(Posterior().FindModes(correlation, {.max_modes = 0}), InvalidOption);
  EXPECT_THROW(Posterior().FindModes(correlation, {.temperature = 0}), InvalidOption);
  EXPECT_THROW(Posterior().FindModes(correlation.head(4)), Error);
}

}  // namespace
}  // namespace antipode
