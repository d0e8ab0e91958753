#include "antipode/evaluation/evaluation.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <random>
#include <utility>

#include <Eigen/Geometry>

#include "antipode/geometry/pose_metrics.h"
#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"
#include "antipode/util/stopwatch.h"

namespace antipode {
namespace {

constexpr double kLikelyProbability = 0.1;
constexpr double kNearTruthDeg = 30;

/// What came of one call of a method: a pose or a message.
struct Attempt {
  std::optional<TwoViewPose> pose;
  std::string failure;
  double seconds = 0;
};

std::string FirstLine(const std::string& text) {
  return text.substr(0, text.find_first_of("\r\n"));
}

Attempt Try(const PoseMethod& method, const PairToEstimate& pair) {
  Attempt attempt;
  const Stopwatch stopwatch;
  try {
    attempt.pose = method.estimate(pair);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    attempt.failure = FirstLine(error.what());
  }
  attempt.seconds = stopwatch.Seconds();
  return attempt;
}

double ViewAngleDeg(const Rigid3& a_from_object, const Rigid3& b_from_object) {
  const Eigen::Vector3d a = a_from_object.OriginInSource();
  const Eigen::Vector3d b = b_from_object.OriginInSource();
  return DegreesFromRadians(std::atan2(a.cross(b).norm(), a.dot(b)));
}

EvaluatedPair DescribePair(const EvaluationScene& scene, const ViewPair& pair,
                           const Rigid3& query_from_reference) {
  const SceneView& reference = scene.views[pair.reference];
  const SceneView& query = scene.views[pair.query];
  EvaluatedPair row;
  row.object = scene.object;
  row.reference = reference.name;
  row.query = query.name;
  row.angle_deg = ViewAngleDeg(reference.camera_from_object, query.camera_from_object);
  row.rotation_deg = RotationAngleDeg(query_from_reference.rotation);
  return row;
}

void RecordFailure(const Attempt& attempt, const Rigid3& truth, EvaluatedPair& row) {
  row.failed = true;
  row.failure = attempt.failure;
  row.translation_error_deg =
      TranslationDirectionErrorDeg(Eigen::Vector3d::Zero(), truth.translation);
}

void RecordPose(const TwoViewPose& pose, const Rigid3& truth, EvaluatedPair& row) {
  row.rotation_error_deg = RotationErrorDeg(pose.query_from_reference.rotation, truth.rotation);
  row.translation_error_deg =
      TranslationDirectionErrorDeg(pose.query_from_reference.translation, truth.translation);
  row.confidence = std::isfinite(pose.confidence) ? pose.confidence : 0;
  row.evidence = pose.evidence;
  for (const PoseHypothesis& hypothesis : pose.hypotheses) {
    if (hypothesis.source == "matching" && !row.matching_error_deg)
      row.matching_error_deg = RotationErrorDeg(hypothesis.query_from_reference.rotation, truth.rotation);
    if (!(hypothesis.probability >= kLikelyProbability)) continue;
    ++row.likely_hypotheses;
    row.truth_among_likely |=
        RotationErrorDeg(hypothesis.query_from_reference.rotation, truth.rotation) < kNearTruthDeg;
  }
}

double SwapDifferenceDeg(const Attempt& attempt, const Attempt& swapped) {
  if (!attempt.pose || !swapped.pose) return 180;
  const Eigen::Matrix3d& rotation = attempt.pose->query_from_reference.rotation;
  const Eigen::Matrix3d& swapped_rotation = swapped.pose->query_from_reference.rotation;
  if (!rotation.allFinite()) return 180;
  return RotationErrorDeg(swapped_rotation.transpose(), rotation);
}

/// At most `most` of the pairs, in their order.
std::vector<ViewPair> DrawPairs(const EvaluationScene& scene, std::size_t most, std::uint64_t seed) {
  std::mt19937_64 random(CombineSeeds(seed, HashOfName(scene.object)));
  std::vector<ViewPair> drawn;
  std::size_t wanted = std::min(most, scene.pairs.size());
  for (std::size_t i = 0; i < scene.pairs.size() && wanted > 0; ++i) {
    // Each of the remaining pairs is equally likely to be among those still wanted.
    if (UniformIndex(random, scene.pairs.size() - i) >= wanted) continue;
    drawn.push_back(scene.pairs[i]);
    --wanted;
  }
  return drawn;
}

class Evaluator {
 public:
  Evaluator(const Dataset& dataset, std::span<const PoseMethod> methods, const EvaluationOptions& options,
            const ProgressCallback& progress)
      : dataset_(dataset), methods_(methods), options_(options), progress_(progress) {
    for (const PoseMethod& method : methods) results_.push_back({dataset.Name(), method.name, {}, 0});
    std::size_t pairs = dataset.PairCount();
    if (options.pairs_per_object) pairs = std::min(pairs, dataset.ObjectCount() * *options.pairs_per_object);
    status_.total = static_cast<std::int64_t>(pairs * methods.size());
  }

  std::vector<EvaluationResult> Run() {
    for (std::size_t i = 0; i < dataset_.ObjectCount(); ++i) {
      Report("loading");
      const Stopwatch stopwatch;
      EvaluationScene scene = dataset_.Load(i);
      if (options_.pairs_per_object) scene.pairs = DrawPairs(scene, *options_.pairs_per_object, options_.seed);
      const double seconds = stopwatch.Seconds();
      for (std::size_t m = 0; m < methods_.size(); ++m) {
        results_[m].loading_seconds += seconds;
        results_[m].objects.push_back(EvaluateObject(scene, methods_[m]));
      }
    }
    Report("done");
    return std::move(results_);
  }

 private:
  EvaluatedObject EvaluateObject(const EvaluationScene& scene, const PoseMethod& method) {
    EvaluatedObject object{scene.object, scene.symmetric, {}, {}};
    for (const ViewPair& pair : scene.pairs) {
      status_.detail = methods_.size() > 1 ? scene.object + " " + method.name : scene.object;
      Report("evaluating");
      EvaluatePair(scene, pair, method, object);
      ++status_.done;
    }
    return object;
  }

  void EvaluatePair(const EvaluationScene& scene, const ViewPair& pair, const PoseMethod& method,
                    EvaluatedObject& object) {
    const SceneView& reference = scene.views.at(pair.reference);
    const SceneView& query = scene.views.at(pair.query);
    const Rigid3 truth = query.camera_from_object * reference.camera_from_object.Inverse();
    EvaluatedPair row = DescribePair(scene, pair, truth);

    const Attempt attempt = Try(method, {scene.object, reference, query});
    row.seconds = attempt.seconds;
    if (attempt.pose) {
      RecordPose(*attempt.pose, truth, row);
      for (const auto& [stage, seconds] : attempt.pose->timings_s)
        object.stage_seconds[stage] += seconds;
    } else {
      RecordFailure(attempt, truth, row);
    }
    if (options_.check_swap)
      row.swap_difference_deg = SwapDifferenceDeg(attempt, Try(method, {scene.object, query, reference}));
    object.pairs.push_back(std::move(row));
  }

  void Report(const std::string& stage) {
    status_.stage = stage;
    if (progress_) progress_(status_);
  }

  const Dataset& dataset_;
  const std::span<const PoseMethod> methods_;
  const EvaluationOptions& options_;
  const ProgressCallback& progress_;
  Progress status_;
  std::vector<EvaluationResult> results_;
};

}  // namespace

PoseMethod OnPhotographs(std::string name, PhotographMethod estimate) {
  return {std::move(name), [estimate = std::move(estimate)](const PairToEstimate& pair) {
            return estimate(pair.reference.photograph, pair.query.photograph);
          }};
}

void EvaluationOptions::Check() const {
  if (pairs_per_object && *pairs_per_object == 0) throw InvalidOption("pairs", "must be positive");
}

std::vector<EvaluationResult> Evaluate(const Dataset& dataset, std::span<const PoseMethod> methods,
                                       const EvaluationOptions& options, const ProgressCallback& progress) {
  options.Check();
  return Evaluator(dataset, methods, options, progress).Run();
}

EvaluationResult Evaluate(const Dataset& dataset, const PoseMethod& method,
                          const EvaluationOptions& options, const ProgressCallback& progress) {
  return Evaluate(dataset, std::span(&method, 1), options, progress).front();
}

}  // namespace antipode
