#include "antipode/orientation/orientation.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/synthesis/turned_picture.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

std::vector<Eigen::Vector3d> PointsOnASphere(int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) points.push_back(0.4 * Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized());
  return points;
}

/// Perfect correspondences of four nearby views, with noise in pixels.
NearbyMatches SyntheticMatches(double elevation_deg, double noise, std::uint64_t seed) {
  const NearbyCameraModel model;
  const auto cameras = HypotheticalCameras(90 - elevation_deg, NearbyOrder::kElevationStage, model);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, noise);
  std::array<std::vector<Eigen::Vector2d>, kNearbyViews> pixels;
  for (const Eigen::Vector3d& point : PointsOnASphere(80, seed)) {
    for (int i = 0; i < kNearbyViews; ++i) {
      const Eigen::Vector3d seen = cameras[i] * point;
      pixels[i].push_back(Eigen::Vector2d::Constant(model.centre) + model.focal_length * seen.head<2>() / seen.z() +
                          Eigen::Vector2d(normal(random), normal(random)));
    }
  }
  NearbyMatches matches;
  for (int first = 0; first < kNearbyViews; ++first)
    for (int second = first + 1; second < kNearbyViews; ++second)
      matches.Set(first, second, {pixels[first], pixels[second], std::vector<double>(80, 0.8)});
  return matches;
}

TEST(SearchElevation, FindsElevationsOfTheWholeRange) {
  for (const double elevation : {-75.0, -60.3, -31.0, 0.0, 12.4, 45.7, 70.0, 78.5})
    EXPECT_NEAR(SearchElevation(SyntheticMatches(elevation, 0, 1), NearbyOrder::kElevationStage).elevation_deg, elevation, 0.7);
}

TEST(SearchElevation, StandsNoise) {
  double worst = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
    worst = std::max(worst, std::abs(SearchElevation(SyntheticMatches(35, 0.3, seed), NearbyOrder::kElevationStage).elevation_deg - 35));
  EXPECT_LT(worst, 6);
}

TEST(SearchElevation, RefusesToGuessWithoutTracks) {
  NearbyMatches none;
  for (int first = 0; first < kNearbyViews; ++first)
    for (int second = first + 1; second < kNearbyViews; ++second) none.Set(first, second, {});
  EXPECT_TRUE(none.AnyEmpty());
  EXPECT_THROW(SearchElevation(none, NearbyOrder::kElevationStage), Error);
}

TEST(MeasureTracks, MissingGroupsCostSomething) {
  NearbyMatches matches = SyntheticMatches(30, 0, 2);
  const auto cameras = HypotheticalCameras(60, NearbyOrder::kElevationStage);
  const double full = MeasureTracks(FindTracks(matches), cameras).robust;
  matches.Set(0, 2, {});
  const TrackErrors poorer = MeasureTracks(FindTracks(matches), cameras);
  EXPECT_GT(poorer.robust, full);
  EXPECT_NEAR(poorer.published, MeasureTracks(FindTracks(SyntheticMatches(30, 0, 2)), cameras).published, 1e-6)
      << "the published score does not see it";
}

TEST(Orientation, AndUpDirectionsAreTheSame) {
  for (const double elevation : {-70.0, -10.0, 0.0, 40.0, 85.0}) {
    for (const double in_plane : {-170.0, -45.0, 0.0, 30.0, 120.0}) {
      const Orientation back = OrientationFromUp(UpFromOrientation({elevation, in_plane, 1, ""}));
      EXPECT_NEAR(back.elevation_deg, elevation, 1e-9);
      EXPECT_NEAR(back.in_plane_rotation_deg, in_plane, 1e-9);
      const Viewpoint viewpoint{.azimuth = 77, .elevation = elevation, .in_plane_rotation = in_plane};
      EXPECT_LT((CameraRotationFromObject(viewpoint).col(1) - UpFromOrientation({elevation, in_plane, 1, ""})).norm(), 1e-12);
    }
  }
}

/// Pictures that carry nothing but the number of their camera, for a matcher that knows the cameras.
class World : public Matcher {
 public:
  World(double elevation_deg, double in_plane_deg) : elevation_(elevation_deg), in_plane_(in_plane_deg), points_(PointsOnASphere(60, 3)) {}

  class Synthesizer : public ViewSynthesizer {
   public:
    Synthesizer(World& world, double turn_deg) : world_(world), turn_(turn_deg) {}
    std::string Fingerprint() const override { return "world"; }
    SynthesisCamera Camera() const override { return {280.0 / 256, 2.7}; }
    void Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                    const ProgressCallback&) const override {
      for (const ViewRequest& request : requests) {
        world_.cameras_.push_back(CameraFromObject({.azimuth = request.relative.azimuth, .elevation = world_.elevation_ - request.relative.polar,
                                                    .in_plane_rotation = world_.in_plane_ - turn_, .distance = 2.7}));
        cv::Mat picture(256, 256, CV_8UC3, cv::Scalar::all(0));
        picture.at<cv::Vec3b>(0, 0)[0] = static_cast<std::uint8_t>(world_.cameras_.size() - 1);
        use(PosedView(request, picture, Camera()));
      }
    }

   private:
    World& world_;
    double turn_;
  };

  Correspondences Match(const cv::Mat& reference, const cv::Mat& query) const override {
    Correspondences list;
    const PinholeCamera camera{256, 256, 280, 280, 128, 128};
    for (const Eigen::Vector3d& point : points_) {
      list.reference.push_back(camera.Project(cameras_[reference.at<cv::Vec3b>(0, 0)[0]] * point));
      list.query.push_back(camera.Project(cameras_[query.at<cv::Vec3b>(0, 0)[0]] * point));
      list.scores.push_back(1);
    }
    return list;
  }

 private:
  double elevation_, in_plane_;
  std::vector<Eigen::Vector3d> points_;
  mutable std::vector<Rigid3> cameras_;
};

TEST(SearchOrientation, FindsElevationAndInPlaneRotation) {
  for (const auto& [elevation, in_plane] : {std::pair{25.0, 0.0}, {40.0, 27.0}, {-20.0, -33.0}}) {
    World world(elevation, in_plane);
    const Orientation found =
        SearchOrientation([&](double turn_deg) { return std::make_unique<World::Synthesizer>(world, turn_deg); }, world);
    EXPECT_NEAR(found.elevation_deg, elevation, 3);
    EXPECT_NEAR(found.in_plane_rotation_deg, in_plane, 3);
    EXPECT_GT(found.certainty, 0.2);
  }
}

TEST(TurnedPose, TurnsThePicture) {
  const Rigid3 pose{Eigen::Matrix3d::Identity(), {0.5, 0, 3}};
  const Eigen::Vector3d moved = TurnedPose(pose, 90) * Eigen::Vector3d::Zero();
  EXPECT_LT((moved - Eigen::Vector3d(0, -0.5, 3)).norm(), 1e-12) << "counter-clockwise: from the right to the top";
}

}  // namespace
}  // namespace antipode
