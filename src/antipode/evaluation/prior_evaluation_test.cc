#include "antipode/evaluation/prior_evaluation.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kDegree = 4;

/// A score with one peak at `rotation`: s(R) = height sum_l (2 l + 1) <D_l(rotation), D_l(R)> / normalisation.
Eigen::VectorXf PeakAt(const Eigen::Matrix3d& rotation, double height) {
  Eigen::VectorXd correlation = WignerMatrices(rotation, kDegree);
  double normalization = 0;
  for (int l = 0; l <= kDegree; ++l) {
    const int size = (2 * l + 1) * (2 * l + 1);
    correlation.segment(WignerOffset(l), size) *= 2 * l + 1;
    normalization += size;
  }
  return (height / normalization * correlation).cast<float>();
}

class Calibration : public ::testing::Test {
 protected:
  double ConfidenceOf(const PriorCalibration& calibration, const Eigen::VectorXf& correlation) const {
    const RotationMode best = posterior_.FindModes(correlation, {.temperature = calibration.temperature}).front();
    const double log_odds = calibration.confidence_slope * LogOdds(best.probability) +
                            calibration.confidence_score_weight * best.score + calibration.confidence_offset;
    return 1 / (1 + std::exp(-log_odds));
  }

  /// True rotations are at the peak with probability `right`, otherwise anywhere.
  ScoredPairs Pairs(double height, double right, int count) {
    ScoredPairs pairs;
    for (int i = 0; i < count; ++i) {
      const Eigen::Matrix3d peak = RandomRotation(random_);
      const bool is_right = i < right * count;
      pairs.same_object.push_back({PeakAt(peak, height), is_right ? peak : RandomRotation(random_)});
    }
    return pairs;
  }

  RotationPosterior posterior_{kDegree, 4000};
  std::mt19937_64 random_{5};
};

TEST_F(Calibration, TheConfidenceIsTheShareOfCorrectPairs) {
  for (const double right : {0.3, 0.8}) {
    const ScoredPairs pairs = Pairs(20, right, 200);
    const PriorCalibration calibration = FitCalibration(posterior_, pairs);
    double sum = 0;
    for (const ScoredPair& pair : pairs.same_object) sum += ConfidenceOf(calibration, pair.correlation);
    EXPECT_NEAR(sum / 200, right, 0.05);
  }
}

TEST_F(Calibration, DifferentObjectsWithLowScoresGetLessConfidence) {
  ScoredPairs pairs = Pairs(20, 0.7, 200);
  for (int i = 0; i < 200; ++i) pairs.different_objects.push_back(PeakAt(RandomRotation(random_), 8));
  const PriorCalibration calibration = FitCalibration(posterior_, pairs);
  EXPECT_GT(calibration.confidence_score_weight, 0);
  EXPECT_LT(ConfidenceOf(calibration, pairs.different_objects.front()), 0.2);
  EXPECT_GT(ConfidenceOf(calibration, pairs.same_object.front().correlation), 0.6);
}

TEST_F(Calibration, NeedsPairs) { EXPECT_THROW(FitCalibration(posterior_, {}), Error); }

}  // namespace
}  // namespace antipode
