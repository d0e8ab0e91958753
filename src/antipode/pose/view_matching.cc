#include "antipode/pose/view_matching.h"

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

bool IsOnObject(const cv::Mat& mask, const Eigen::Vector2d& pixel) {
  const cv::Point cell(static_cast<int>(std::floor(pixel.x())), static_cast<int>(std::floor(pixel.y())));
  return cv::Rect({0, 0}, mask.size()).contains(cell) && mask.at<std::uint8_t>(cell) > 125;
}

Correspondences MatchTurned(const Matcher& matcher, const ObjectView& reference, const ObjectView& query,
                            int quarter_turns) {
  const Correspondences found = matcher.Match(reference.image, QuarterTurned(query.image, quarter_turns));
  Correspondences kept;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Eigen::Vector2d in_query = TurnPixel(found.query[i], 4 - quarter_turns, query.image.cols);
    if (!IsOnObject(reference.mask, found.reference[i]) || !IsOnObject(query.mask, in_query)) continue;
    kept.reference.push_back(found.reference[i]);
    kept.query.push_back(in_query);
    kept.scores.push_back(found.scores[i]);
  }
  return kept;
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
    MatchedViews candidate{MatchTurned(matcher, reference, query, turn), {}, turn};
    candidate.geometry =
        EstimateTwoViewGeometry(candidate.correspondences, {reference.camera, query.camera}, options.geometry);
    if (candidate.geometry.inliers > best.geometry.inliers || best.correspondences.size() == 0) best = std::move(candidate);
    if (best.geometry.inliers >= options.enough_inliers) break;
  }
  return best;
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
