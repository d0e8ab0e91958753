#include "antipode/pose/view_matching.h"

#include <numbers>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

constexpr int kSide = 200;

/// Knows where 50 points of the ball around the object are, but only while the query's true up is up: the
/// picture's first pixel tells how it is turned.
class UprightMatcher : public Matcher {
 public:
  UprightMatcher(const ObjectView& reference, const ObjectView& query, const Rigid3& query_from_reference,
                 int turns_needed)
      : turns_needed_(turns_needed) {
    std::mt19937_64 random(3);
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector3d point = 0.6 * (RandomRotation(random) * Eigen::Vector3d::UnitX()) + Eigen::Vector3d(0, 0, 4);
      points_.reference.push_back(reference.camera.Project(point));
      Eigen::Vector2d pixel = query.camera.Project(query_from_reference * point);
      for (int turn = 0; turn < turns_needed; ++turn) pixel = {kSide - pixel.y(), pixel.x()};
      points_.query.push_back(pixel);
      points_.scores.push_back(1);
    }
  }

  Correspondences Match(const cv::Mat&, const cv::Mat& query) const override {
    ++calls;
    const cv::Point corners[] = {{0, 0}, {kSide - 1, 0}, {kSide - 1, kSide - 1}, {0, kSide - 1}};
    return query.at<cv::Vec3b>(corners[turns_needed_])[0] == 7 ? points_ : Correspondences{};
  }

  mutable int calls = 0;

 private:
  int turns_needed_;
  Correspondences points_;
};

ObjectView MarkedView() {
  ObjectView view;
  view.distance = 4;
  view.image = cv::Mat(kSide, kSide, CV_8UC3, cv::Scalar::all(100));
  view.image.at<cv::Vec3b>(0, 0)[0] = 7;
  view.mask = cv::Mat(kSide, kSide, CV_8UC1, cv::Scalar(255));
  view.camera = {kSide, kSide, 350, 350, kSide / 2.0, kSide / 2.0};
  return view;
}

TEST(MatchObjectViews, FindsTheTurnThatMatchesAndThePoseOfTheUnturnedQuery) {
  const ObjectView view = MarkedView();
  const Eigen::Vector3d centre(0, 0, 4);
  for (int turns = 0; turns < 4; ++turns) {
    const Eigen::Matrix3d rotation = RotationAboutZ(-turns * std::numbers::pi / 2) * RotationAboutY(0.5);
    const UprightMatcher matcher(view, view, {rotation, centre - rotation * centre}, turns);
    const MatchedViews matched = MatchObjectViews(matcher, view, view);
    EXPECT_EQ(matched.quarter_turns, turns);
    EXPECT_EQ(matched.geometry.inliers, 50);
    EXPECT_LT(AngleBetweenDeg(matched.geometry.query_from_reference.rotation, rotation), 0.01);
    EXPECT_EQ(QuarterTurnsUndoing(rotation), turns);
  }
}

TEST(MatchObjectViews, StopsOnceThereAreEnoughInliers) {
  const ObjectView view = MarkedView();
  const Eigen::Matrix3d rotation = RotationAboutY(0.5);
  const UprightMatcher matcher(view, view, {rotation, Eigen::Vector3d(0, 0, 4) - rotation * Eigen::Vector3d(0, 0, 4)}, 0);
  MatchObjectViews(matcher, view, view, {.enough_inliers = 40});
  EXPECT_EQ(matcher.calls, 1);
}

TEST(MatchObjectViews, ListsWhatElseTheMatchesMayMeanNearTheStarts) {
  const ObjectView view = MarkedView();
  const Eigen::Matrix3d rotation = RotationAboutY(0.5), far = RotationAboutY(-2.5);
  const UprightMatcher matcher(view, view, {rotation, Eigen::Vector3d(0, 0, 4) - rotation * Eigen::Vector3d(0, 0, 4)}, 0);
  const Eigen::Matrix3d near = RotationAboutX(0.05) * rotation;
  const MatchedViews matched = MatchObjectViews(matcher, view, view, {.starts = {near, far}});
  EXPECT_EQ(matched.geometry.inliers, 50);
  for (const TwoViewGeometry& other : matched.alternatives) {
    EXPECT_LE(other.inliers, matched.geometry.inliers);
    EXPECT_GT(AngleBetweenDeg(other.query_from_reference.rotation, rotation), 5) << "one that is there already";
  }
}

TEST(MatchObjectViews, LeavesOutMatchesBesideTheObject) {
  ObjectView view = MarkedView();
  const Eigen::Matrix3d rotation = RotationAboutY(0.5);
  const UprightMatcher matcher(view, view, {rotation, Eigen::Vector3d(0, 0, 4) - rotation * Eigen::Vector3d(0, 0, 4)}, 0);
  view.mask.colRange(0, kSide / 2) = 0;
  EXPECT_LT(MatchObjectViews(matcher, view, view).correspondences.size(), 40u);
  view.mask = 0;
  const MatchedViews nothing = MatchObjectViews(matcher, view, view);
  EXPECT_EQ(nothing.correspondences.size(), 0u);
  EXPECT_EQ(nothing.geometry.status, TwoViewStatus::kTooFewMatches);
}

}  // namespace
}  // namespace antipode
