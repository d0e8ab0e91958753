#include "antipode/pose/view_matching.h"

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kSamePoseDeg = 5;

bool IsOnObject(const cv::Mat& mask, const Eigen::Vector2d& pixel) {
  const cv::Point cell(static_cast<int>(std::floor(pixel.x())), static_cast<int>(std::floor(pixel.y())));
  return cv::Rect({0, 0}, mask.size()).contains(cell) && mask.at<std::uint8_t>(cell) > 125;
}

Correspondences MatchTurned(const Matcher& matcher, const ObjectView& reference, const ObjectView& query,
                            int quarter_turns) {
  Correspondences found = matcher.Match(reference.image, QuarterTurned(query.image, quarter_turns));
  for (Eigen::Vector2d& pixel : found.query) pixel = TurnPixel(pixel, 4 - quarter_turns, query.image.cols);
  return OnObject(found, reference.mask, query.mask);
}

/// Between the crop cameras, both of which have the object's centre on their axes.
Rigid3 PoseOfCrops(const ObjectView& reference, const ObjectView& query, const Eigen::Matrix3d& rotation) {
  return {rotation, query.distance * Eigen::Vector3d::UnitZ() - reference.distance * rotation.col(2)};
}

/// The pose that the matches give by themselves, and those near the starts; most inliers first, without
/// failures and repetitions.
std::vector<TwoViewGeometry> Explanations(const Correspondences& correspondences, const ObjectView& reference,
                                          const ObjectView& query, const ViewMatchingOptions& options) {
  const CameraPair cameras{reference.camera, query.camera};
  std::vector<TwoViewGeometry> found{EstimateTwoViewGeometry(correspondences, cameras, options.geometry)};
  for (const Eigen::Matrix3d& start : options.starts) {
    const Rigid3 pose = PoseOfCrops(reference, query, start);
    if (pose.translation.norm() > 0)
      found.push_back(RefineTwoViewGeometry(correspondences, cameras, pose, options.capture_px, options.geometry));
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const TwoViewGeometry& a, const TwoViewGeometry& b) { return a.inliers > b.inliers; });
  std::vector<TwoViewGeometry> distinct;
  for (TwoViewGeometry& geometry : found) {
    const bool is_known = std::ranges::any_of(distinct, [&](const TwoViewGeometry& other) {
      return AngleBetweenDeg(other.query_from_reference.rotation, geometry.query_from_reference.rotation) < kSamePoseDeg;
    });
    if (geometry.status != TwoViewStatus::kTooFewMatches && !is_known) distinct.push_back(std::move(geometry));
  }
  return distinct;
}

MatchedViews Explain(const Matcher& matcher, const ObjectView& reference, const ObjectView& query, int turn,
                     const ViewMatchingOptions& options) {
  MatchedViews matched{MatchTurned(matcher, reference, query, turn), {}, {}, turn};
  matched.geometry.is_inlier.assign(matched.correspondences.size(), 0);
  matched.alternatives = Explanations(matched.correspondences, reference, query, options);
  if (matched.alternatives.empty()) return matched;
  matched.geometry = std::move(matched.alternatives.front());
  matched.alternatives.erase(matched.alternatives.begin());
  return matched;
}

}  // namespace

void ViewMatchingOptions::Check() const {
  geometry.Check();
  const bool possible = std::all_of(quarter_turns.begin(), quarter_turns.end(), [](int turn) { return turn >= 0 && turn < 4; });
  if (quarter_turns.empty() || !possible) throw InvalidOption("quarter_turns", "must list numbers from 0 to 3");
}

MatchedViews MatchObjectViews(const Matcher& matcher, const ObjectView& reference, const ObjectView& query,
                              const ViewMatchingOptions& options) {
  options.Check();
  MatchedViews best;
  for (const int turn : options.quarter_turns) {
    MatchedViews candidate = Explain(matcher, reference, query, turn, options);
    if (candidate.geometry.inliers > best.geometry.inliers || best.correspondences.size() == 0) best = std::move(candidate);
    if (best.geometry.inliers >= options.enough_inliers) break;
  }
  return best;
}

Correspondences OnObject(const Correspondences& correspondences, const cv::Mat& reference_mask, const cv::Mat& query_mask) {
  Correspondences kept;
  for (std::size_t i = 0; i < correspondences.size(); ++i) {
    const Eigen::Vector2d &in_reference = correspondences.reference[i], &in_query = correspondences.query[i];
    if (!IsOnObject(reference_mask, in_reference) || !IsOnObject(query_mask, in_query)) continue;
    kept.reference.push_back(in_reference);
    kept.query.push_back(in_query);
    kept.scores.push_back(correspondences.scores[i]);
  }
  return kept;
}

cv::Mat QuarterTurned(const cv::Mat& image, int quarter_turns) {
  cv::Mat turned;
  switch (quarter_turns) {
    case 1: cv::rotate(image, turned, cv::ROTATE_90_CLOCKWISE); return turned;
    case 2: cv::rotate(image, turned, cv::ROTATE_180); return turned;
    case 3: cv::rotate(image, turned, cv::ROTATE_90_COUNTERCLOCKWISE); return turned;
    default: return image;
  }
}

Eigen::Vector2d TurnPixel(Eigen::Vector2d pixel, int quarter_turns, double side) {
  for (int i = 0; i < quarter_turns; ++i) pixel = {side - pixel.y(), pixel.x()};
  return pixel;
}

int QuarterTurnsUndoing(const Eigen::Matrix3d& rotation) {
  const double turned = std::atan2(rotation(1, 0) - rotation(0, 1), rotation(0, 0) + rotation(1, 1));
  const int quarters = static_cast<int>(std::lround(-turned / (std::numbers::pi / 2)));
  return (quarters + 4) % 4;
}

}  // namespace antipode
