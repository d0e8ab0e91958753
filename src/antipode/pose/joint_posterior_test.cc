#include "antipode/pose/joint_posterior.h"

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/so3_grid.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

const Eigen::Matrix3d kLikely = RotationAboutY(-1.2);
const Eigen::Matrix3d kUnlikely = RotationAboutY(0.6) * RotationAboutX(0.2);

/// 85 % of the mass around one rotation and 15 % around another.
class TwoModes {
 public:
  explicit TwoModes(const Eigen::Matrix3d& likely = kLikely, const Eigen::Matrix3d& unlikely = kUnlikely) : grid_(SuperFibonacciRotations(8000)) {
    posterior.rotations = grid_;
    posterior.weights.resize(static_cast<Eigen::Index>(grid_.size()));
    for (std::size_t i = 0; i < grid_.size(); ++i)
      posterior.weights[static_cast<Eigen::Index>(i)] = 0.85 * Bell(grid_[i], likely) + 0.15 * Bell(grid_[i], unlikely);
    posterior.weights /= posterior.weights.sum();
    modes = {{likely, 0.85}, {unlikely, 0.15}};
  }

  GridPosterior posterior;
  std::vector<RotationMode> modes;

 private:
  static double Bell(const Eigen::Matrix3d& rotation, const Eigen::Matrix3d& mode) {
    return std::exp(-std::pow(AngleBetweenDeg(rotation, mode) / 8, 2) / 2);
  }

  std::vector<Eigen::Matrix3d> grid_;
};

const CentredCameras kCameras{{{640, 640, 1000, 1000, 320, 320}, {640, 640, 1000, 1000, 320, 320}}, 4, 4};

/// Exact ones of a rotation about the object's centre.
Correspondences MatchesOf(const Eigen::Matrix3d& rotation, int count) {
  Correspondences matches;
  std::mt19937_64 random(5);
  const Eigen::Vector3d centre(0, 0, 4);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d on_object = 0.8 * (RandomRotation(random) * Eigen::Vector3d::UnitX());
    matches.reference.push_back(kCameras.cameras.reference.Project(centre + on_object));
    matches.query.push_back(kCameras.cameras.query.Project(centre + rotation * on_object));
    matches.scores.push_back(1);
  }
  return matches;
}

double SumOfShares(const std::vector<JointHypothesis>& hypotheses) {
  double sum = 0;
  for (const JointHypothesis& hypothesis : hypotheses) sum += hypothesis.share;
  return sum;
}

TEST(WeighTogether, KeepsThePriorsOrderWithoutMatches) {
  const TwoModes prior;
  const auto hypotheses = WeighTogether(CentredGeometry({}, kCameras), prior.posterior, prior.modes, {});
  ASSERT_GE(hypotheses.size(), 2U);
  EXPECT_LT(AngleBetweenDeg(hypotheses[0].query_crop_from_reference_crop.rotation, kLikely), 5);
  EXPECT_NEAR(hypotheses[0].share, 0.85, 0.05);
  EXPECT_NEAR(SumOfShares(hypotheses), 1, 1e-9);
}

TEST(WeighTogether, LetsMatchesChooseAnotherMode) {
  const TwoModes prior;
  const auto hypotheses = WeighTogether(CentredGeometry(MatchesOf(kUnlikely, 60), kCameras), prior.posterior, prior.modes, {});
  EXPECT_LT(AngleBetweenDeg(hypotheses[0].query_crop_from_reference_crop.rotation, kUnlikely), 1);
  EXPECT_GT(hypotheses[0].support, 55);
  EXPECT_GT(hypotheses[0].share, 0.8);
  EXPECT_NEAR(SumOfShares(hypotheses), 1, 1e-9);
}

TEST(WeighTogether, FindsARotationThatIsNoMode) {
  const TwoModes prior;
  const Eigen::Matrix3d between = RotationAboutY(-0.3) * RotationAboutX(0.5);
  const auto hypotheses = WeighTogether(CentredGeometry(MatchesOf(between, 200), kCameras), prior.posterior, prior.modes, {});
  EXPECT_LT(AngleBetweenDeg(hypotheses[0].query_crop_from_reference_crop.rotation, between), 2);
  EXPECT_TRUE(hypotheses[0].is_refined);
}

TEST(WeighTogether, LeavesOutWhatIsNearABetterOne) {
  const TwoModes prior;
  const auto hypotheses = WeighTogether(CentredGeometry(MatchesOf(kUnlikely, 60), kCameras), prior.posterior, prior.modes, {});
  for (std::size_t i = 0; i < hypotheses.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_GE(AngleBetweenDeg(hypotheses[i].query_crop_from_reference_crop.rotation,
                                hypotheses[j].query_crop_from_reference_crop.rotation), 30);
}

/// Hypotheses of the prior alone: kLikely, then kUnlikely.
std::vector<JointHypothesis> WithoutMatches(const TwoModes& prior) {
  auto hypotheses = WeighTogether(CentredGeometry({}, kCameras), prior.posterior, prior.modes, {});
  hypotheses.resize(2);
  return hypotheses;
}

/// Finds matches only under rotations near the true one.
MatchGivenRotation MatchesNear(const Eigen::Matrix3d& truth, int count) {
  return [=](const Eigen::Matrix3d& rotation) {
    return AngleBetweenDeg(rotation, truth) < 15 ? MatchesOf(truth, count) : Correspondences{};
  };
}

TEST(WeighByOwnMatches, KeepsTheOrderWhereNoneHasMatches) {
  const TwoModes prior;
  const auto before = WithoutMatches(prior);
  const auto after = WeighByOwnMatches(before, prior.posterior, kCameras, [](const Eigen::Matrix3d&) { return Correspondences{}; });
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i) {
    EXPECT_TRUE(after[i].query_crop_from_reference_crop.rotation.isApprox(before[i].query_crop_from_reference_crop.rotation));
    EXPECT_EQ(after[i].matches, 0U);
  }
  EXPECT_NEAR(SumOfShares(after), 1, 1e-9);
}

TEST(WeighByOwnMatches, DoubtsThatCamerasAreNearWhereTheyHaveNothingInCommon) {
  const Eigen::Matrix3d near = RotationAboutY(0.2), far = RotationAboutY(2);
  const TwoModes prior(near, far);
  const auto after = WeighByOwnMatches(WithoutMatches(prior), prior.posterior, kCameras, [](const Eigen::Matrix3d&) { return Correspondences{}; });
  EXPECT_LT(AngleBetweenDeg(after[0].query_crop_from_reference_crop.rotation, far), 5);
  const auto matched = WeighByOwnMatches(WithoutMatches(prior), prior.posterior, kCameras, MatchesNear(near, 60));
  EXPECT_LT(AngleBetweenDeg(matched[0].query_crop_from_reference_crop.rotation, near), 5);
}

TEST(WeighByOwnMatches, PrefersTheHypothesisUnderWhichMatchesAreFound) {
  const TwoModes prior;
  const auto after = WeighByOwnMatches(WithoutMatches(prior), prior.posterior, kCameras, MatchesNear(kUnlikely, 200));
  EXPECT_LT(AngleBetweenDeg(after[0].query_crop_from_reference_crop.rotation, kUnlikely), 1);
  EXPECT_GT(after[0].support, 185);
  EXPECT_EQ(after[0].matches, 200U);
  EXPECT_TRUE(after[0].is_refined);
  EXPECT_GT(after[0].share, 0.8);
  EXPECT_NEAR(SumOfShares(after), 1, 1e-9);
}

TEST(WeighByOwnMatches, KeepsThePoseOfTheMatchesOfAllWhereTheySayMore) {
  const TwoModes prior;
  const auto before = WeighTogether(CentredGeometry(MatchesOf(kUnlikely, 200), kCameras), prior.posterior, prior.modes, {});
  const auto after = WeighByOwnMatches(before, prior.posterior, kCameras, MatchesNear(kUnlikely, 20));
  EXPECT_EQ(after[0].matches, 200U);
  EXPECT_EQ(after[0].support, before[0].support);
}

TEST(WeighByOwnMatches, TakesFewMatchesForChance) {
  const TwoModes prior;
  const auto after = WeighByOwnMatches(WithoutMatches(prior), prior.posterior, kCameras, MatchesNear(kUnlikely, 7), {.least_matches = 8});
  EXPECT_LT(AngleBetweenDeg(after[0].query_crop_from_reference_crop.rotation, kLikely), 5);
  for (const JointHypothesis& hypothesis : after) EXPECT_EQ(hypothesis.matches, 0U);
}

TEST(WeighByOwnMatches, MatchesNoMoreHypothesesThanAsked) {
  const TwoModes prior;
  const auto calls = [&](const OwnMatchesOptions& options) {
    int count = 0;
    const auto match = [&](const Eigen::Matrix3d&) { return ++count, Correspondences{}; };
    WeighByOwnMatches(WithoutMatches(prior), prior.posterior, kCameras, match, options);
    return count;
  };
  EXPECT_EQ(calls({}), 2);
  EXPECT_EQ(calls({.most_hypotheses = 1}), 1);
  EXPECT_EQ(calls({.most_hypotheses = 0}), 0);
  EXPECT_EQ(calls({.least_share = 0.5}), 1);
}

TEST(WeighByOwnMatches, RefusesImpossibleOptions) {
  const TwoModes prior;
  const auto none = [](const Eigen::Matrix3d&) { return Correspondences{}; };
  for (const OwnMatchesOptions& options : {OwnMatchesOptions{.most_hypotheses = -1}, {.least_share = 2}, {.separation_deg = 0}})
    EXPECT_THROW(WeighByOwnMatches(WithoutMatches(prior), prior.posterior, kCameras, none, options), InvalidOption);
}

TEST(WeighTogether, RefusesImpossibleOptions) {
  const TwoModes prior;
  EXPECT_THROW(WeighTogether(CentredGeometry({}, kCameras), prior.posterior, prior.modes, {}, {.starts = 0}), InvalidOption);
}

}  // namespace
}  // namespace antipode
