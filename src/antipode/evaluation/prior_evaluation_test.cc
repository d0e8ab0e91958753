#include "antipode/evaluation/prior_evaluation.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/spherical_harmonics.h"
#include "antipode/prior/correlation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kDegree = 4;

/// A prior whose encoder is never asked.
ObjectPrior PriorOfDegree4() {
  ObjectEncoderConfig config;
  config.max_degree = kDegree;
  config.width = config.heads = config.layers = config.feed_forward = 1;
  return {ObjectEncoder(config), torch::kCPU};
}

/// Codes whose score is s(R) = height sum_l (2 l + 1) <D_l(rotation), D_l(R)> / normalisation: every harmonic is a
/// function of its own, with square root sqrt(2 l + 1) in both codes.
CodedPair PeakAt(const Eigen::Matrix3d& rotation, double height) {
  const int count = SphericalHarmonicCount(kDegree);
  auto reference = torch::zeros({count, count});
  double normalization = 0;
  for (int l = 0; l <= kDegree; ++l) {
    normalization += (2 * l + 1) * (2 * l + 1);
    for (int i = l * l; i < (l + 1) * (l + 1); ++i) reference[i][i] = std::sqrt(2.0 * l + 1);
  }
  reference *= std::sqrt(height / normalization);
  return {reference, TurnCode(reference, rotation), rotation};
}

class Calibration : public ::testing::Test {
 protected:
  double ConfidenceOf(const PriorCalibration& calibration, const CodedPair& pair) const {
    const RotationMode best = prior_.Hypotheses(pair.reference, pair.query, {.temperature = calibration.temperature}).front();
    const double log_odds = calibration.confidence_slope * LogOdds(best.probability) +
                            calibration.confidence_score_weight * best.score + calibration.confidence_offset;
    return 1 / (1 + std::exp(-log_odds));
  }

  /// True rotations are at the peak with probability `right`, otherwise anywhere.
  CodedPairs Pairs(double height, double right, int count) {
    CodedPairs pairs;
    for (int i = 0; i < count; ++i) {
      const Eigen::Matrix3d peak = RandomRotation(random_);
      const bool is_right = i < right * count;
      pairs.same_object.push_back(PeakAt(peak, height));
      if (!is_right) pairs.same_object.back().query_from_reference = RandomRotation(random_);
    }
    return pairs;
  }

  const ObjectPrior prior_ = PriorOfDegree4();
  std::mt19937_64 random_{5};
};

TEST_F(Calibration, TheConfidenceIsTheShareOfCorrectPairs) {
  for (const double right : {0.3, 0.8}) {
    const CodedPairs pairs = Pairs(20, right, 200);
    const PriorCalibration calibration = FitCalibration(prior_, pairs);
    double sum = 0;
    for (const CodedPair& pair : pairs.same_object) sum += ConfidenceOf(calibration, pair);
    EXPECT_NEAR(sum / 200, right, 0.05);
  }
}

TEST_F(Calibration, DifferentObjectsWithLowScoresGetLessConfidence) {
  CodedPairs pairs = Pairs(20, 0.7, 200);
  for (int i = 0; i < 200; ++i) pairs.different_objects.push_back(PeakAt(RandomRotation(random_), 8));
  const PriorCalibration calibration = FitCalibration(prior_, pairs);
  EXPECT_GT(calibration.confidence_score_weight, 0);
  EXPECT_LT(ConfidenceOf(calibration, pairs.different_objects.front()), 0.2);
  EXPECT_GT(ConfidenceOf(calibration, pairs.same_object.front()), 0.6);
}

TEST_F(Calibration, NeedsPairs) { EXPECT_THROW(FitCalibration(prior_, {}), Error); }

}  // namespace
}  // namespace antipode
