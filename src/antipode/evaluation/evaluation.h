#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "antipode/evaluation/dataset.h"
#include "antipode/pose/two_view_pose.h"
#include "antipode/util/progress.h"

namespace antipode {

/// What is asked of a method.
struct PairToEstimate {
  const std::string& object;
  const SceneView& reference;  ///< methods must not look at `camera_from_object`
  const SceneView& query;
};

/// Anything that estimates the pose of a pair.
struct PoseMethod {
  std::string name;
  std::function<TwoViewPose(const PairToEstimate& pair)> estimate;
};

/// A method that needs nothing but the photographs.
using PhotographMethod =
    std::function<TwoViewPose(const ObjectPhotograph& reference, const ObjectPhotograph& query)>;
PoseMethod OnPhotographs(std::string name, PhotographMethod estimate);

struct EvaluationOptions {
  bool check_swap = false;  ///< also estimate (query, reference); doubles the time
  std::optional<std::size_t> pairs_per_object = {};  ///< at most; which ones is drawn
  std::uint64_t seed = 1;                       ///< draws them
  void Check() const;
};

/// What a method made of one pair.
struct EvaluatedPair {
  std::string object, reference, query;
  double angle_deg = 0;     ///< between the two views as seen from the object's centre, 0..180
  double rotation_deg = 0;  ///< of the true rotation query_from_reference, 0..180
  double rotation_error_deg = 180;
  std::optional<double> translation_error_deg;  ///< of the direction; nothing if the true one is 0
  double confidence = 0;
  double seconds = 0;       ///< of the estimate alone
  bool failed = false;      ///< the method threw: errors 180, confidence 0
  std::string failure;      ///< its message, one line
  std::map<std::string, double> evidence;  ///< see TwoViewPose
  /// Rotation error of the best hypothesis that comes from matching, if there is one.
  std::optional<double> matching_error_deg;
  int likely_hypotheses = 0;         ///< of probability 0.1 or more
  bool truth_among_likely = false;   ///< one of these is within 30 degrees of the true rotation
  /// Between the inverse of the estimate for (query, reference) and the estimate; 180 if either
  /// failed; nothing if it was not checked.
  std::optional<double> swap_difference_deg;
};

struct EvaluatedObject {
  std::string object;
  bool symmetric = false;
  std::vector<EvaluatedPair> pairs;
  std::map<std::string, double> stage_seconds;  ///< sums of `TwoViewPose::timings_s` over the pairs
};

struct EvaluationResult {
  std::string dataset, method;
  std::vector<EvaluatedObject> objects;
  double loading_seconds = 0;  ///< rendering or reading the images of all objects
};

/// Runs every method on every pair of `dataset`, object by object, so that all see the same images. What a
/// method throws counts as a failure of that pair, except `Interrupted`. One result a method, in their order.
/// @param progress called before every object and every pair, and at the end; may be empty
std::vector<EvaluationResult> Evaluate(const Dataset& dataset, std::span<const PoseMethod> methods,
                                       const EvaluationOptions& options = {},
                                       const ProgressCallback& progress = {});

/// The same with one method.
EvaluationResult Evaluate(const Dataset& dataset, const PoseMethod& method,
                          const EvaluationOptions& options = {},
                          const ProgressCallback& progress = {});

}  // namespace antipode
