#include "antipode/matching/centred_geometry.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

/// Points of an object of radius 1, seen by two cameras in whose middle it is 500 pixels wide.
struct Scene {
  CentredCameras cameras;
  Rigid3 query_from_reference;
  Correspondences correspondences;
};

constexpr double kSide = 640;

PinholeCamera CropCamera(double distance) {
  return {static_cast<int>(kSide), static_cast<int>(kSide), 250 * distance, 250 * distance, kSide / 2, kSide / 2};
}

Eigen::Vector2d SomePixel(std::mt19937_64& random) { return {UniformIn(random, 70, kSide - 70), UniformIn(random, 70, kSide - 70)}; }

class SceneMaker {
 public:
  explicit SceneMaker(double distance) : distance_(distance) {}

  Eigen::Vector3d offset_in_query = Eigen::Vector3d::Zero();
  Eigen::Vector3d flattening = Eigen::Vector3d::Ones();
  int points = 60, outliers = 0;

  Scene Make(const Eigen::Matrix3d& rotation) const {
    Scene scene{{{CropCamera(distance_), CropCamera(distance_)}, distance_, distance_}, {}, {}};
    const Eigen::Vector3d centre(0, 0, distance_);
    scene.query_from_reference = {rotation, centre + offset_in_query - rotation * centre};
    std::mt19937_64 random(5);
    for (int i = 0; i < points + outliers; ++i) {
      const Eigen::Vector3d on_object = 0.9 * (RandomRotation(random) * Eigen::Vector3d::UnitX()).cwiseProduct(flattening);
      const Eigen::Vector3d point = centre + on_object;
      scene.correspondences.reference.push_back(scene.cameras.cameras.reference.Project(point));
      const Eigen::Vector2d seen = scene.cameras.cameras.query.Project(scene.query_from_reference * point);
      scene.correspondences.query.push_back(i < points ? seen : SomePixel(random));
      scene.correspondences.scores.push_back(1);
    }
    return scene;
  }

 private:
  double distance_;
};

const Eigen::Matrix3d kTurn = RotationAboutY(0.6) * RotationAboutX(-0.3) * RotationAboutZ(0.2);

TEST(CentredGeometry, SupportsTheTruthByEveryMatch) {
  const Scene scene = SceneMaker(4).Make(kTurn);
  const auto pose = CentredGeometry(scene.correspondences, scene.cameras).Centred(kTurn);
  EXPECT_NEAR(pose.support, 60, 1e-6);
  EXPECT_LT((pose.query_from_reference.translation - scene.query_from_reference.translation).norm(), 1e-9);
}

TEST(CentredGeometry, RefinesAStartThatIsSomeDegreesOff) {
  SceneMaker maker(4);
  maker.outliers = 90;
  const Scene scene = maker.Make(kTurn);
  const CentredGeometry geometry(scene.correspondences, scene.cameras);
  const Eigen::Matrix3d start = kTurn * RotationFromVector({0.06, -0.08, 0.05});
  ASSERT_GT(AngleBetweenDeg(start, kTurn), 6);
  const auto pose = geometry.Refine(start);
  EXPECT_LT(AngleBetweenDeg(pose.query_from_reference.rotation, kTurn), 2);
  EXPECT_GT(pose.support, 55);
}

TEST(CentredGeometry, IsNotMisledByAPlane) {
  SceneMaker maker(4);
  maker.flattening = {1, 1, 0};
  const Scene scene = maker.Make(kTurn);
  const auto pose = CentredGeometry(scene.correspondences, scene.cameras).Refine(kTurn * RotationAboutX(0.1));
  EXPECT_LT(AngleBetweenDeg(pose.query_from_reference.rotation, kTurn), 2);
}

TEST(CentredGeometry, FollowsACentreThatIsOffTheAxis) {
  SceneMaker maker(4);
  maker.offset_in_query = {0.1, -0.08, 0.4};
  const Scene scene = maker.Make(kTurn);
  const auto pose = CentredGeometry(scene.correspondences, scene.cameras).Refine(kTurn);
  EXPECT_LT(AngleBetweenDeg(pose.query_from_reference.rotation, kTurn), 1.5);
  const Eigen::Vector3d found = pose.query_from_reference.translation.normalized();
  EXPECT_LT(DegreesFromRadians(std::acos(found.dot(scene.query_from_reference.translation.normalized()))), 2);
}

TEST(CentredGeometry, TellsALargeTurnFromASmallOneThroughALongLens) {
  const Scene scene = SceneMaker(40).Make(RotationAboutY(0.7));
  const CentredGeometry geometry(scene.correspondences, scene.cameras);
  EXPECT_GT(geometry.Centred(RotationAboutY(0.7)).support, 1.5 * geometry.Centred(RotationAboutY(0.1)).support);
}

TEST(CentredGeometry, DoesNotTakeCamerasAtOnePlaceForAnExplanation) {
  const Scene scene = SceneMaker(4).Make(kTurn);
  EXPECT_LT(CentredGeometry(scene.correspondences, scene.cameras).Centred(Eigen::Matrix3d::Identity()).support, 6);
}

TEST(CentredGeometry, SearchFindsTheTruthAmongOtherRotations) {
  SceneMaker maker(4);
  maker.outliers = 60;
  maker.points = 400;
  const Scene scene = maker.Make(kTurn);
  std::mt19937_64 random(8);
  std::vector<Eigen::Matrix3d> rotations{kTurn * RotationAboutX(0.03)};
  for (int i = 0; i < 300; ++i) rotations.push_back(RandomRotation(random));
  const Eigen::VectorXf support = CentredGeometry(scene.correspondences, scene.cameras).SearchSupport(rotations);
  Eigen::Index best = -1;
  EXPECT_GT(support.maxCoeff(&best), 300);
  EXPECT_EQ(best, 0);
}

TEST(CentredGeometry, WithoutMatchesSupportsNothing) {
  const Scene scene = SceneMaker(4).Make(kTurn);
  const CentredGeometry geometry({}, scene.cameras);
  EXPECT_EQ(geometry.Refine(kTurn).support, 0);
  EXPECT_EQ(geometry.SearchSupport(std::vector<Eigen::Matrix3d>{kTurn})[0], 0);
}

TEST(CentredGeometry, RefusesImpossibleInput) {
  Scene scene = SceneMaker(4).Make(kTurn);
  EXPECT_THROW(CentredGeometry(scene.correspondences, scene.cameras, {.scale_px = 0}), InvalidOption);
  EXPECT_THROW(CentredGeometry(scene.correspondences, scene.cameras, {.search_scale_px = 1}), InvalidOption);
  scene.cameras.query_distance = 0;
  EXPECT_THROW(CentredGeometry(scene.correspondences, scene.cameras), Error);
}

}  // namespace
}  // namespace antipode
