#pragma once

#include <map>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "antipode/geometry/camera.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/object/object_view.h"
#include "antipode/prior/object_prior.h"

namespace antipode {

/// One photograph with everything known about it.
struct ObjectPhotograph {
  cv::Mat image;                      ///< 8UC3, RGB
  cv::Mat mask;                       ///< 8UC1, > 125 is object
  PinholeCamera camera;
};

struct PoseHypothesis {
  Rigid3 query_from_reference;  ///< translation in object radii
  double probability = 0;       ///< posterior mass within 15 degrees of the rotation
};

/// The relative pose of two photographs: x_query = R x_reference + t.
struct TwoViewPose {
  Rigid3 query_from_reference;             ///< that of the best hypothesis
  double confidence = 0;                   ///< calibrated: how often a rotation error is below 30 degrees
  std::vector<PoseHypothesis> hypotheses;  ///< best first; probabilities sum to at most 1
  ObjectView reference, query;             ///< the object-centric crops that were compared
  std::map<std::string, double> timings_s; ///< "crop", "encode", "compare"
  std::vector<std::string> warnings;
};

struct TwoViewPoseOptions {
  int hypotheses = 5;  ///< how many to list at most
  void Check() const;
};

/// The route `prior`: crops, codes, posterior, composition of the pose (paper, eq. for R12, t12).
TwoViewPose EstimatePose(const ObjectPrior& prior, const ObjectPhotograph& reference,
                         const ObjectPhotograph& query, const TwoViewPoseOptions& options = {});

}  // namespace antipode
