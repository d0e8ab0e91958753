#include "antipode/evaluation/evaluation_summary.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "antipode/util/seeds.h"

namespace antipode {
namespace {

EvaluatedPair Pair(double rotation_error, std::optional<double> translation_error,
                   double angle = 10, double confidence = 0) {
  EvaluatedPair pair;
  pair.rotation_error_deg = rotation_error;
  pair.translation_error_deg = translation_error;
  pair.angle_deg = angle;
  pair.confidence = confidence;
  return pair;
}

EvaluationResult ResultOf(std::vector<EvaluatedObject> objects) {
  EvaluationResult result;
  result.dataset = "objects";
  result.method = "test";
  result.objects = std::move(objects);
  return result;
}

EvaluatedObject Object(const std::string& name, std::vector<EvaluatedPair> pairs) {
  EvaluatedObject object;
  object.object = name;
  object.pairs = std::move(pairs);
  return object;
}

TEST(Summarize, MeansPairsOfAnObjectThenObjects) {
  const EvaluationSummary summary = Summarize(ResultOf(
      {Object("a", {Pair(14.99, 1), Pair(15, 40), Pair(29.99, 29), Pair(30, 100)}),
       Object("b", {Pair(1, 14)})}));
  EXPECT_EQ(summary.pairs, 5u);
  EXPECT_DOUBLE_EQ(summary.rotation.acc15, (25 + 100) / 2.0);
  EXPECT_DOUBLE_EQ(summary.rotation.acc30, (75 + 100) / 2.0);
  EXPECT_DOUBLE_EQ(summary.rotation.median, 15);
  EXPECT_DOUBLE_EQ(summary.translation.acc15, (25 + 100) / 2.0);
  EXPECT_DOUBLE_EQ(summary.translation.acc30, (50 + 100) / 2.0);
  EXPECT_DOUBLE_EQ(summary.translation.median, 29);
  ASSERT_EQ(summary.objects.size(), 2u);
  EXPECT_EQ(summary.objects[0].object, "a");
  EXPECT_EQ(summary.objects[0].pairs, 4u);
  EXPECT_DOUBLE_EQ(summary.objects[0].rotation.acc15, 25);
  EXPECT_DOUBLE_EQ(summary.objects[1].translation.acc30, 100);
}

TEST(Summarize, UndefinedTranslationsAreCountedAndLeftOut) {
  const EvaluationSummary summary = Summarize(
      ResultOf({Object("a", {Pair(1, 1), Pair(1, std::nullopt)}),
                Object("b", {Pair(40, std::nullopt)}), Object("c", {Pair(1, 50)})}));
  EXPECT_EQ(summary.translation.undefined, 2u);
  EXPECT_DOUBLE_EQ(summary.translation.acc30, 50);  // of a and c
  EXPECT_EQ(summary.rotation.undefined, 0u);
  EXPECT_NEAR(summary.rotation.acc30, 200.0 / 3, 1e-9);
  ASSERT_TRUE(summary.translation.acc30_interval.has_value());
}

TEST(Summarize, FailuresAreCountedByMessage) {
  EvaluatedPair failed = Pair(180, 180);
  failed.failed = true;
  failed.failure = "no object";
  const EvaluationSummary summary =
      Summarize(ResultOf({Object("a", {failed, Pair(1, 1), failed, Pair(1, 1)})}));
  EXPECT_EQ(summary.failures, 2u);
  EXPECT_EQ(summary.failure_messages.at("no object"), 2u);
  EXPECT_DOUBLE_EQ(summary.rotation.acc30, 50);
  EXPECT_EQ(summary.objects[0].failures, 2u);
}

TEST(Summarize, BinsByAnglePoolPairsOfAllObjects) {
  const EvaluationSummary summary = Summarize(
      ResultOf({Object("a", {Pair(10, 10, 44.9), Pair(20, 10, 45), Pair(20, 20, 89)}),
                Object("b", {Pair(40, 10, 60), Pair(1, 1, 180), Pair(1, 40, 135)})}));
  ASSERT_EQ(summary.angle_bins.size(), 4u);
  EXPECT_EQ(summary.angle_bins[0].pairs, 1u);
  EXPECT_EQ(summary.angle_bins[1].pairs, 3u);
  EXPECT_EQ(summary.angle_bins[2].pairs, 0u);
  EXPECT_EQ(summary.angle_bins[3].pairs, 2u);
  EXPECT_DOUBLE_EQ(summary.angle_bins[0].rotation.acc15, 100);
  EXPECT_DOUBLE_EQ(summary.angle_bins[1].rotation.acc15, 0);
  EXPECT_NEAR(summary.angle_bins[1].rotation.acc30, 200.0 / 3, 1e-9);
  EXPECT_NEAR(summary.angle_bins[1].translation.acc15, 200.0 / 3, 1e-9);
  EXPECT_TRUE(std::isnan(summary.angle_bins[2].rotation.acc15));
  EXPECT_DOUBLE_EQ(summary.angle_bins[3].translation.acc30, 50);
}

TEST(Summarize, MeansOfSecondsHypothesesAndSwaps) {
  std::vector<EvaluatedPair> pairs(4, Pair(1, 1));
  pairs[0].seconds = 1;
  pairs[1].seconds = 3;
  pairs[0].likely_hypotheses = 2;
  pairs[0].truth_among_likely = true;
  pairs[0].swap_difference_deg = 0.5;
  pairs[1].swap_difference_deg = 1;
  EvaluatedObject object = Object("a", pairs);
  object.pairs[3].failed = true;
  object.stage_seconds["encode"] = 6;
  const EvaluationSummary summary = Summarize(ResultOf({object}));
  EXPECT_DOUBLE_EQ(summary.seconds_per_pair, 1);
  EXPECT_DOUBLE_EQ(summary.stage_seconds_per_pair.at("encode"), 2);  // of 3 that succeeded
  EXPECT_DOUBLE_EQ(summary.likely_hypotheses, 0.5);
  EXPECT_DOUBLE_EQ(summary.truth_among_likely, 25);
  EXPECT_DOUBLE_EQ(summary.swap_consistent.value(), 50);
}

TEST(Summarize, NothingGivesNoFigures) {
  const EvaluationSummary summary = Summarize(ResultOf({}));
  EXPECT_EQ(summary.pairs, 0u);
  EXPECT_TRUE(std::isnan(summary.rotation.acc15));
  EXPECT_TRUE(std::isnan(summary.seconds_per_pair));
  EXPECT_FALSE(summary.swap_consistent.has_value());
  EXPECT_FALSE(summary.rotation.acc15_interval.has_value());
}

TEST(Calibrate, HandMadeExample) {
  // Bin 2: confidence 0.25 and 0.21, one right: |0.5 - 0.23| of 2/5. Bin 9: 0.9 and 1, both right:
  // |1 - 0.95| of 2/5. Bin 0: 0, wrong: 0.
  const std::vector<double> confidences{0.25, 0.9, 1, 0.21, 0};
  const Calibration calibration = Calibrate(confidences, {true, true, true, false, false});
  ASSERT_EQ(calibration.bins.size(), 10u);
  EXPECT_EQ(calibration.bins[2].pairs, 2u);
  EXPECT_EQ(calibration.bins[9].pairs, 2u);
  EXPECT_EQ(calibration.bins[0].pairs, 1u);
  EXPECT_DOUBLE_EQ(calibration.bins[2].mean_confidence, 0.23);
  EXPECT_DOUBLE_EQ(calibration.bins[2].share_correct, 0.5);
  EXPECT_NEAR(calibration.expected_error, 0.4 * 0.27 + 0.4 * 0.05, 1e-12);
}

TEST(Calibrate, HonestConfidencesHaveSmallErrorAndBoastsALargeOne) {
  std::mt19937_64 random(1);
  std::vector<double> honest, boast;
  std::vector<bool> correct;
  for (int i = 0; i < 20000; ++i) {
    honest.push_back(UniformIn(random, 0, 1));
    boast.push_back(1);
    correct.push_back(UniformIn(random, 0, 1) < honest.back());
  }
  EXPECT_LT(Calibrate(honest, correct).expected_error, 0.02);
  EXPECT_NEAR(Calibrate(boast, correct).expected_error, 0.5, 0.02);
}

TEST(BootstrapInterval, HoldsTheMeanAndShrinksWithMoreObjects) {
  std::mt19937_64 random(2);
  double width = 1000;
  for (const int count : {10, 100, 1000}) {
    std::vector<double> values;
    for (int i = 0; i < count; ++i) values.push_back(UniformIn(random, 0, 100));
    double mean = 0;
    for (const double value : values) mean += value / count;
    const Interval interval = BootstrapInterval(values).value();
    EXPECT_LT(interval.low, mean);
    EXPECT_GT(interval.high, mean);
    EXPECT_LT(interval.high - interval.low, width / 2);
    // The normal approximation: 3.92 standard errors of a uniform distribution.
    width = interval.high - interval.low;
    EXPECT_NEAR(width, 3.92 * 100 / std::sqrt(12.0 * count), 0.25 * width);
  }
}

TEST(BootstrapInterval, RepeatsAndNeedsTwoValues) {
  const std::vector<double> values{10, 20, 90};
  EXPECT_EQ(BootstrapInterval(values)->low, BootstrapInterval(values)->low);
  EXPECT_EQ(BootstrapInterval(values)->low, 10);  // all the same object: 1/27 of the resamples
  EXPECT_FALSE(BootstrapInterval(std::vector<double>{10}).has_value());
}

TEST(WithoutSymmetricObjects, KeepsTheOthers) {
  EvaluatedObject symmetric = Object("can", {Pair(170, 170)});
  symmetric.symmetric = true;
  const EvaluationResult rest =
      WithoutSymmetricObjects(ResultOf({symmetric, Object("shoe", {Pair(1, 1)})}));
  ASSERT_EQ(rest.objects.size(), 1u);
  EXPECT_EQ(rest.objects[0].object, "shoe");
  EXPECT_DOUBLE_EQ(Summarize(rest).rotation.acc15, 100);
}

}  // namespace
}  // namespace antipode
