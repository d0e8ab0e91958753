#include "antipode/geometry/pose_metrics.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(RotationError, IsTheAngleBetweenTheRotations) {
  std::mt19937_64 generator(1);
  for (int degrees = 0; degrees <= 180; degrees += 5) {
    const Eigen::Matrix3d truth = RandomRotation(generator);
    const Eigen::Vector3d axis = RandomRotation(generator) * Eigen::Vector3d::UnitX();
    const Eigen::Matrix3d estimate = RotationFromVector(RadiansFromDegrees(degrees) * axis) * truth;
    EXPECT_NEAR(RotationErrorDeg(estimate, truth), degrees, 1e-12);
  }
  EXPECT_EQ(RotationErrorDeg(Eigen::Matrix3d::Constant(kNaN), Eigen::Matrix3d::Identity()), 180);
}

TEST(TranslationError, IgnoresLengthButNotSign) {
  const Eigen::Vector3d truth(1, 2, 3);
  EXPECT_NEAR(*TranslationDirectionErrorDeg(5 * truth, truth), 0, 1e-12);
  EXPECT_NEAR(*TranslationDirectionErrorDeg(-5 * truth, truth), 180, 1e-12);
  EXPECT_NEAR(*TranslationDirectionErrorDeg({0, 0, 2}, {3, 0, 0}), 90, 1e-12);
  EXPECT_NEAR(*TranslationDirectionErrorDeg(1e-200 * truth, 1e200 * truth), 0, 1e-12);
}

TEST(TranslationError, IsUndefinedOnlyWithoutATrueDirection) {
  EXPECT_FALSE(TranslationDirectionErrorDeg({1, 0, 0}, {0, 0, 0}).has_value());
  EXPECT_EQ(TranslationDirectionErrorDeg({0, 0, 0}, {1, 0, 0}), 180);
  EXPECT_EQ(TranslationDirectionErrorDeg({kNaN, 0, 0}, {1, 0, 0}), 180);
}

TEST(TranslationError, NeverNaNWhereThePublishedFormulaIs) {
  std::mt19937_64 generator(2);
  int undefined = 0;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d truth = RandomRotation(generator) * Eigen::Vector3d(1, 2, 3);
    const double published = PublishedTranslationErrorDeg(3 * truth, truth);
    undefined += std::isnan(published);
    EXPECT_LT(*TranslationDirectionErrorDeg(3 * truth, truth), 1e-12);
  }
  EXPECT_GT(undefined, 0);
  EXPECT_TRUE(std::isnan(PublishedTranslationErrorDeg({1, 0, 0}, {0, 0, 0})));
}

TEST(TranslationError, AgreesWithThePublishedFormula) {
  std::mt19937_64 generator(3);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d a = RandomRotation(generator) * Eigen::Vector3d(1, 2, 3);
    const Eigen::Vector3d b = RandomRotation(generator) * Eigen::Vector3d(1, 2, 3);
    EXPECT_NEAR(*TranslationDirectionErrorDeg(a, b), PublishedTranslationErrorDeg(a, b), 1e-6);
  }
}

TEST(Accuracy, CountsStrictlyBelowAndNaNAsFailure) {
  const std::vector<double> errors = {0, 14.999, 15, kNaN, 30, 180};
  EXPECT_DOUBLE_EQ(FractionBelow(errors, 15), 2.0 / 6);
  EXPECT_DOUBLE_EQ(FractionBelow(errors, 30), 3.0 / 6);
  EXPECT_TRUE(std::isnan(FractionBelow({}, 15)));
}

TEST(MedianOfErrors, HandlesOddEvenAndFailed) {
  EXPECT_EQ(Median(std::vector<double>{3, 1, 2}), 2);
  EXPECT_EQ(Median(std::vector<double>{4, 1, 2, 3}), 2.5);
  EXPECT_EQ(Median(std::vector<double>{kNaN, 1, kNaN}), kInfinity);
  EXPECT_TRUE(std::isnan(Median({})));
}

TEST(Summary, AveragesPerObjectThenOverObjects) {
  const std::vector<ObjectErrors> objects = {{"one", {10, 20, 40, 50}},
                                             {"two", {10}},
                                             {"undefined", {std::nullopt}},
                                             {"three", {std::nullopt, 100}}};
  const ErrorSummary summary = SummarizeErrors(objects, std::vector<double>{15, 30});
  EXPECT_EQ(summary.pairs, 8u);
  EXPECT_EQ(summary.undefined, 2u);
  ASSERT_EQ(summary.accuracy.size(), 2u);
  EXPECT_DOUBLE_EQ(summary.accuracy[0], (0.25 + 1 + 0) / 3);
  EXPECT_DOUBLE_EQ(summary.accuracy[1], (0.5 + 1 + 0) / 3);
  EXPECT_DOUBLE_EQ(summary.median, 30);
}

}  // namespace
}  // namespace antipode
