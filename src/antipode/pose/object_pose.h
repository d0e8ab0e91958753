#pragma once

#include <map>
#include <string>
#include <vector>

#include "antipode/matching/matcher.h"
#include "antipode/pose/reference.h"
#include "antipode/pose/two_view_pose.h"
#include "antipode/pose/view_comparison.h"

namespace antipode {

struct ObjectPoseHypothesis {
  Rigid3 camera_from_object;
  double probability = 0;  ///< that the rotation is within 15 degrees of the truth
  std::string source = "prior";  ///< "prior", "selector", "matching" or "refiner": what its rotation comes from
};

/// Where a known object is in a photograph.
struct ObjectPose {
  std::vector<ObjectPoseHypothesis> hypotheses;  ///< best first
  double confidence = 0;  ///< how often a rotation error is below 30 degrees
  ObjectView view;        ///< the object-centric crop
  std::map<std::string, double> timings_s, evidence;
  std::vector<std::string> warnings;
};

struct ObjectPoseOptions {
  int hypotheses = 5;        ///< modes of the posterior or selected views, each verified by matching with the view nearest to it
  int refine_iterations = 3; ///< of the refiner, if there is one
  int least_views_to_refine = 32;  ///< the refiner compares with the views near to a pose; far ones mislead it
  ViewMatchingOptions matching;
  void Check() const;
};

/// What finds poses; all but the prior may be null.
struct ObjectPoseModels {
  const ObjectPrior* prior = nullptr;
  const Matcher* matcher = nullptr;
  ViewComparison* comparison = nullptr;  ///< prepared for the reference
};

/// Pose of the object of a reference in a photograph. Coarse: the modes of the prior's posterior given all views, or the
/// views that the selector chooses. Then they are verified, and their rotations refined, by matches with the views near to
/// them, and the best ones, at most four, last by the refiner: a rotation of the matches stays where it nearly confirms it. A reference of few views
/// is a warning, and is not refined.
ObjectPose EstimateObjectPose(const Reference& reference, const ObjectPoseModels& models, const ObjectPhotograph& photograph,
                              const ObjectPoseOptions& options = {});

/// Both object poses composed: every hypothesis of the query with the best of the reference.
TwoViewPose ComposeObjectPoses(ObjectPose reference, ObjectPose query);

/// The query relative to the photograph that the reference was built from, or to the object if there is none.
TwoViewPose RelativeToSource(const Reference& reference, ObjectPose query);

/// The index of the view whose direction from the object is nearest to that of a camera with this rotation.
std::size_t NearestView(const Reference& reference, const Eigen::Matrix3d& camera_from_object);

/// Where an object of this rotation is in a crop: its size and place there are those of the nearest view.
Rigid3 PlaceObject(const Reference& reference, const ObjectView& crop, const Eigen::Matrix3d& crop_from_object);

}  // namespace antipode
