#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "antipode/matching/matcher.h"
#include "antipode/matching/two_view_geometry.h"
#include "antipode/object/object_view.h"

namespace antipode {

struct ViewMatchingOptions {
  /// Quarter turns clockwise by which the query is turned before matching, in the order of trying: learned
  /// features stand some 30 degrees of in-plane rotation, not 90.
  std::vector<int> quarter_turns{0, 1, 3, 2};
  int enough_inliers = 80;  ///< so many, and no further turn is tried
  /// Rotations query_crop_from_reference_crop that matches are refined from, beside the one they give themselves.
  std::vector<Eigen::Matrix3d> starts = {};
  double capture_px = 33;   ///< matches within this distance of a start's epipolar lines speak for it
  TwoViewGeometryOptions geometry = {};
  void Check() const;
};

/// Correspondences between two object-centric crops and the pose that they give.
struct MatchedViews {
  Correspondences correspondences;  ///< pixels of the crops, on the object in both
  TwoViewGeometry geometry;         ///< between the crop cameras: the one with the most inliers
  std::vector<TwoViewGeometry> alternatives;  ///< what else the matches may mean, most inliers first
  int quarter_turns = 0;            ///< the turn that matched best
};

/// Matches two crops, the query turned in steps of 90 degrees, and keeps the turn with the most inliers.
MatchedViews MatchObjectViews(const Matcher& matcher, const ObjectView& reference, const ObjectView& query,
                              const ViewMatchingOptions& options = {});

/// Those of the correspondences that are on the object in both masks (8UC1, > 125 is object).
Correspondences OnObject(const Correspondences& correspondences, const cv::Mat& reference_mask, const cv::Mat& query_mask);

/// The picture turned clockwise by 0 to 3 quarter turns, without copying for 0.
cv::Mat QuarterTurned(const cv::Mat& image, int quarter_turns);

/// Where a pixel of a square picture goes when that is turned clockwise by `quarter_turns`.
Eigen::Vector2d TurnPixel(Eigen::Vector2d pixel, int quarter_turns, double side);

/// The quarter turns clockwise of the query, 0 to 3, that undo the in-plane part of a rotation: the rotation
/// about the optical axis nearest to R turns by atan2(R_21 - R_12, R_11 + R_22).
int QuarterTurnsUndoing(const Eigen::Matrix3d& query_crop_from_reference_crop);

}  // namespace antipode
