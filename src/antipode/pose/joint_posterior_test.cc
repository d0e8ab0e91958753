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
  TwoModes() : grid_(SuperFibonacciRotations(8000)) {
    posterior.rotations = grid_;
    posterior.weights.resize(static_cast<Eigen::Index>(grid_.size()));
    for (std::size_t i = 0; i < grid_.size(); ++i)
      posterior.weights[static_cast<Eigen::Index>(i)] = 0.85 * Bell(grid_[i], kLikely) + 0.15 * Bell(grid_[i], kUnlikely);
    posterior.weights /= posterior.weights.sum();
    modes = {{kLikely, 0.85}, {kUnlikely, 0.15}};
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

TEST(WeighTogether, RefusesImpossibleOptions) {
  const TwoModes prior;
  EXPECT_THROW(WeighTogether(CentredGeometry({}, kCameras), prior.posterior, prior.modes, {}, {.starts = 0}), InvalidOption);
}

}  // namespace
}  // namespace antipode
