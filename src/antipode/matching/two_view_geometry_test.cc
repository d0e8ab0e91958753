#include "antipode/matching/two_view_geometry.h"

#include <cmath>

#include <gtest/gtest.h>

#include "antipode/geometry/pose_metrics.h"
#include "antipode/geometry/rotation.h"
#include "antipode/matching/depth_pose.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

constexpr int kSeeds = 10;

const CameraPair kCameras{{640, 480, 500, 500, 320, 240}, {512, 512, 600, 600, 256, 256}};

/// Points in the unit ball about a point in front of both cameras, with noise and outliers.
struct World {
  Rigid3 query_from_reference;
  std::vector<Eigen::Vector3d> points;  ///< in reference axes
  Correspondences correspondences;
  int true_matches = 0;
};

double Normal(std::mt19937_64& random) {
  return std::sqrt(-2 * std::log(1 - UniformIn(random, 0, 1))) * std::cos(UniformIn(random, 0, 2 * std::numbers::pi));
}

Eigen::Vector3d InBall(std::mt19937_64& random) {
  Eigen::Vector3d point;
  do {
    point = {UniformIn(random, -1, 1), UniformIn(random, -1, 1), UniformIn(random, -1, 1)};
  } while (point.norm() > 1);
  return point;
}

/// The object's centre lies on both optical axes at a distance of 4.
Rigid3 OrbitedBy(const Eigen::Matrix3d& rotation) {
  const Eigen::Vector3d centre(0, 0, 4);
  return {rotation, centre - rotation * centre};
}

/// About an axis that is far from the optical one: turning about that moves no camera.
Eigen::Matrix3d OrbitRotation(std::mt19937_64& random, double angle_deg) {
  const Eigen::Vector3d axis = InBall(random).cwiseProduct(Eigen::Vector3d(1, 1, 0.3)).normalized();
  return RotationFromVector(axis * RadiansFromDegrees(angle_deg));
}

World MakeWorld(std::uint64_t seed, double angle_deg, int matches, int outliers, double noise_px, bool flat = false) {
  std::mt19937_64 random(seed);
  World world;
  world.query_from_reference = OrbitedBy(OrbitRotation(random, angle_deg));
  world.true_matches = matches;
  for (int i = 0; i < matches + outliers; ++i) {
    Eigen::Vector3d point = InBall(random);
    if (flat) point.z() = 0.3 * point.x();
    point.z() += 4;
    world.points.push_back(point);
    const auto noise = [&]() -> Eigen::Vector2d { return Eigen::Vector2d(Normal(random), Normal(random)) * noise_px; };
    world.correspondences.reference.push_back(kCameras.reference.Project(point) + noise());
    const Eigen::Vector3d other = i < matches ? point : Eigen::Vector3d(InBall(random) + Eigen::Vector3d(0, 0, 4));
    world.correspondences.query.push_back(kCameras.query.Project(world.query_from_reference * other) + noise());
    world.correspondences.scores.push_back(1);
  }
  return world;
}

double RotationError(const TwoViewGeometry& geometry, const World& world) {
  return RotationErrorDeg(geometry.query_from_reference.rotation, world.query_from_reference.rotation);
}

double DirectionError(const TwoViewGeometry& geometry, const World& world) {
  return *TranslationDirectionErrorDeg(geometry.query_from_reference.translation, world.query_from_reference.translation);
}

TEST(TwoViewGeometry, IsExactWithoutNoise) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    const World world = MakeWorld(seed, 40, 100, 0, 0);
    const TwoViewGeometry geometry = EstimateTwoViewGeometry(world.correspondences, kCameras);
    EXPECT_EQ(geometry.status, TwoViewStatus::kFound);
    EXPECT_EQ(geometry.inliers, 100);
    EXPECT_LT(RotationError(geometry, world), 1e-3);
    EXPECT_LT(DirectionError(geometry, world), 1e-3);
    EXPECT_NEAR(geometry.query_from_reference.translation.norm(), 1, 1e-12);
  }
}

TEST(TwoViewGeometry, StandsNoiseAndHalfOutliers) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    const World world = MakeWorld(seed, 30, 150, 150, 0.5);
    const TwoViewGeometry geometry = EstimateTwoViewGeometry(world.correspondences, kCameras);
    EXPECT_LT(RotationError(geometry, world), 2) << seed;
    EXPECT_LT(DirectionError(geometry, world), 4) << seed;
    EXPECT_GT(geometry.inliers, 130) << seed;
  }
}

TEST(TwoViewGeometry, TheCovarianceTellsTheErrorItMakes) {
  double squared_error = 0, predicted = 0;
  for (int seed = 0; seed < 40; ++seed) {
    const World world = MakeWorld(seed, 30, 120, 0, 0.5);
    const TwoViewGeometry geometry = EstimateTwoViewGeometry(world.correspondences, kCameras);
    squared_error += std::pow(RotationError(geometry, world), 2);
    predicted += 3 * std::pow(geometry.RotationDeviationDeg(), 2);
  }
  EXPECT_GT(squared_error / predicted, 0.4);
  EXPECT_LT(squared_error / predicted, 2.5);
}

TEST(TwoViewGeometry, NamesDegenerateCases) {
  const World flat = MakeWorld(1, 25, 200, 0, 0.2, true);
  EXPECT_EQ(EstimateTwoViewGeometry(flat.correspondences, kCameras).status, TwoViewStatus::kPlanar);

  World turned = MakeWorld(2, 0, 200, 0, 0);
  for (std::size_t i = 0; i < turned.points.size(); ++i)
    turned.correspondences.query[i] = kCameras.query.Project(RotationAboutY(0.1) * turned.points[i]);
  const TwoViewGeometry turn = EstimateTwoViewGeometry(turned.correspondences, kCameras);
  EXPECT_EQ(turn.status, TwoViewStatus::kPureRotation);
  EXPECT_LT(AngleBetweenDeg(turn.query_from_reference.rotation, RotationAboutY(0.1)), 1e-6);

  const World few = MakeWorld(3, 25, 5, 0, 0);
  const TwoViewGeometry nothing = EstimateTwoViewGeometry(few.correspondences, kCameras);
  EXPECT_EQ(nothing.status, TwoViewStatus::kTooFewMatches);
  EXPECT_EQ(nothing.is_inlier.size(), 5u);
  EXPECT_EQ(EstimateTwoViewGeometry({}, kCameras).status, TwoViewStatus::kTooFewMatches);
}

TEST(TwoViewGeometry, ChanceMatchesHaveFewInliers) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    const World world = MakeWorld(seed, 40, 0, 200, 0);
    EXPECT_LT(EstimateTwoViewGeometry(world.correspondences, kCameras).inliers, 50);
  }
}

TEST(TwoViewGeometry, RefiningGoesFromANearbyPoseToTheTruth) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    const World world = MakeWorld(seed, 50, 100, 30, 0.2);
    std::mt19937_64 random(seed);
    const Eigen::Matrix3d off = RotationFromVector(InBall(random).normalized() * RadiansFromDegrees(8)) * world.query_from_reference.rotation;
    const TwoViewGeometry geometry = RefineTwoViewGeometry(world.correspondences, kCameras, OrbitedBy(off), 40);
    EXPECT_LT(RotationError(geometry, world), 1) << seed;
  }
}

TEST(TwoViewGeometry, DistancesVanishAtTheTruthOnly) {
  const World world = MakeWorld(4, 30, 50, 0, 0);
  for (const double distance : SampsonDistances(world.correspondences, kCameras, world.query_from_reference))
    EXPECT_LT(distance, 1e-9);
  Rigid3 wrong = world.query_from_reference;
  wrong.rotation = RotationAboutX(0.2) * wrong.rotation;
  double sum = 0;
  for (const double distance : SampsonDistances(world.correspondences, kCameras, wrong)) sum += distance;
  EXPECT_GT(sum / 50, 5);
}

TEST(TwoViewGeometry, RefusesImpossibleOptions) {
  EXPECT_THROW(EstimateTwoViewGeometry({}, kCameras, {.threshold_px = 0}), InvalidOption);
  EXPECT_THROW(EstimateTwoViewGeometry({}, kCameras, {.least_inliers = 5}), InvalidOption);
}

/// Depth images that know the points of a world only.
cv::Mat DepthOf(const std::vector<Eigen::Vector2d>& pixels, const std::vector<Eigen::Vector3d>& points, cv::Size size) {
  cv::Mat depth = cv::Mat::zeros(size, CV_32F);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const cv::Point cell(static_cast<int>(pixels[i].x()), static_cast<int>(pixels[i].y()));
    if (cv::Rect({0, 0}, size).contains(cell)) depth.at<float>(cell) = static_cast<float>(points[i].z());
  }
  return depth;
}

TEST(DepthPose, BothWaysFindTheMetricPose) {
  const World world = MakeWorld(5, 40, 80, 20, 0);
  std::vector<Eigen::Vector3d> in_query;
  for (const auto& point : world.points) in_query.push_back(world.query_from_reference * point);
  const cv::Mat reference_depth = DepthOf(world.correspondences.reference, world.points, {640, 480});
  const cv::Mat query_depth = DepthOf(world.correspondences.query, in_query, {512, 512});
  for (const auto& pose : {PoseFromPnp(world.correspondences, kCameras, reference_depth),
                           PoseFromProcrustes(world.correspondences, kCameras, reference_depth, query_depth)}) {
    ASSERT_TRUE(pose.has_value());
    EXPECT_LT(RotationErrorDeg(pose->rotation, world.query_from_reference.rotation), 1);
    EXPECT_LT((pose->translation - world.query_from_reference.translation).norm(), 0.1);
  }
}

TEST(DepthPose, SaysWhenThereIsTooLittle) {
  const cv::Mat unknown = cv::Mat::zeros(480, 640, CV_32F);
  const World world = MakeWorld(6, 40, 80, 0, 0);
  EXPECT_FALSE(PoseFromPnp(world.correspondences, kCameras, unknown).has_value());
  EXPECT_FALSE(PoseFromProcrustes(world.correspondences, kCameras, unknown, unknown).has_value());
  EXPECT_THROW(PoseFromPnp(world.correspondences, kCameras, {}), Error);
}

}  // namespace
}  // namespace antipode
