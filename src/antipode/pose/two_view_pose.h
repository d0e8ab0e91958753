#pragma once

#include <map>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "antipode/geometry/camera.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/object/object_view.h"
#include "antipode/pose/view_matching.h"
#include "antipode/prior/object_prior.h"

namespace antipode {

/// One photograph with everything known about it.
struct ObjectPhotograph {
  cv::Mat image;                      ///< 8UC3, RGB
  cv::Mat mask;                       ///< 8UC1, > 125 is object
  PinholeCamera camera;
  cv::Mat depth{};                    ///< 32FC1 along the optical axis, 0 where unknown; empty if there is none
};

struct PoseHypothesis {
  Rigid3 query_from_reference;  ///< translation in object radii
  double probability = 0;       ///< that the rotation is within 15 degrees of the truth; with `auto`, 30
  std::string source = "prior"; ///< "prior" or "matching"
};

enum class LengthUnit { kObjectRadius, kDepth };

/// The relative pose of two photographs: x_query = R x_reference + t.
struct TwoViewPose {
  Rigid3 query_from_reference;             ///< that of the best hypothesis
  /// Whether lengths are in object radii, or in the unit of given depths.
  LengthUnit length_unit = LengthUnit::kObjectRadius;
  double confidence = 0;                   ///< calibrated: how often a rotation error is below 30 degrees
  std::vector<PoseHypothesis> hypotheses;  ///< best first; probabilities sum to at most 1
  ObjectView reference, query;             ///< the object-centric crops that were compared
  std::map<std::string, double> timings_s; ///< "crop", "encode", "compare", "match", "weigh", "rematch"
  /// What speaks for the pose. With matching: "matches" and "inliers", those that agree on a pose among themselves, which
  /// with the prior need not be this one; with matching alone: "rotation_deviation_deg",
  /// "translation_disagreement_deg", see MatchingEvidence; with prior and matching: "share", "support", "prior_mass", see
  /// JointHypothesis, and "prior_confidence", that of the prior alone.
  std::map<std::string, double> evidence;
  std::vector<std::string> warnings;
};

struct TwoViewPoseOptions {
  int hypotheses = 5;       ///< how many to list at most
  int matching_size = 640;  ///< side of the crops that are matched, pixels
  CameraRoll roll = CameraRoll::kAny;  ///< what the prior may assume of the cameras
  ViewMatchingOptions matching;
  void Check() const;
};

/// The route `prior`: crops, codes, posterior, composition of the pose (paper, eq. for R12, t12).
TwoViewPose EstimatePose(const ObjectPrior& prior, const ObjectPhotograph& reference,
                         const ObjectPhotograph& query, const TwoViewPoseOptions& options = {});

/// The route `matching`: crops, correspondences, two-view geometry. One hypothesis; its translation has the
/// direction that the correspondences give, where they determine it, and the length that the crops give.
/// @throws Error if there are too few consistent correspondences
TwoViewPose EstimatePoseByMatching(const Matcher& matcher, const ObjectPhotograph& reference,
                                   const ObjectPhotograph& query, const TwoViewPoseOptions& options = {});

/// The route `auto`: the modes of the prior and what the matches make of them and of other rotations, weighed together
/// (joint_posterior.h). Matching tries the turns of the query that the prior's modes suggest; the best hypotheses are then
/// matched again, each with both crops turned to where a camera halfway would stand (halfway_matching.h).
TwoViewPose EstimatePoseByBoth(const ObjectPrior& prior, const Matcher& matcher, const ObjectPhotograph& reference,
                               const ObjectPhotograph& query, const TwoViewPoseOptions& options = {});

/// What matching alone found, as `MatchingProbability` weighs it.
struct MatchingEvidence {
  int matches = 0;
  int inliers = 0;
  double rotation_deviation_deg = 180;  ///< see TwoViewGeometry
  /// Angle between the translation of the matches and that of the crops with the rotation of the matches: both
  /// cameras look at the object, so a wrong essential matrix rarely agrees.
  double translation_disagreement_deg = 180;
};

/// How often the rotation of matching alone is within 15 degrees of the truth: a logistic function of the evidence,
/// fitted by scripts/fit_confidence.py on validation objects.
double MatchingProbability(const MatchingEvidence& evidence);

/// What prior and matches say together of the best hypothesis.
struct JointEvidence {
  double share = 0;             ///< see JointHypothesis
  double support = 0;           ///< of the matches, see CentredGeometry
  double prior_confidence = 0;  ///< of the prior alone in its best mode
};

/// How often the best hypothesis of prior and matches together is within 30 degrees of the truth: a logistic function of the
/// log odds of the share and, where matches support little, of the prior's confidence, which also knows whether both
/// pictures look like one object. Fitted on validation objects, where pairs that show two different objects count as wrong.
double JointConfidence(const JointEvidence& evidence);

}  // namespace antipode
