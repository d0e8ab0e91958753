#include "antipode/evaluation/false_confidence.h"

#include <algorithm>
#include <random>
#include <utility>

#include "antipode/util/error.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

const SceneView& DrawView(const EvaluationScene& scene, std::mt19937_64& random) {
  if (scene.views.empty()) throw Error(scene.object, "has no views");
  return scene.views[UniformIndex(random, scene.views.size())];
}

class Measurement {
 public:
  Measurement(const PoseMethod& method, const FalseConfidenceOptions& options, const ProgressCallback& progress)
      : method_(method), random_(options.seed), progress_(progress) {
    status_.stage = "different objects";
    status_.total = options.pairs;
  }

  void Compare(const EvaluationScene& reference, const EvaluationScene& query) {
    status_.detail = reference.object + " and " + query.object;
    if (progress_) progress_(status_);
    result_.confidences.push_back(ConfidenceOf(reference, query));
    ++status_.done;
  }

  FalseConfidence Result() {
    if (progress_) progress_(status_);
    return std::move(result_);
  }

 private:
  double ConfidenceOf(const EvaluationScene& reference, const EvaluationScene& query) {
    const SceneView& a = DrawView(reference, random_);
    const SceneView& b = DrawView(query, random_);
    try {
      return method_.estimate({reference.object, a, b}).confidence;
    } catch (const Interrupted&) {
      throw;
    } catch (const Error&) {
      ++result_.failures;
      return 0;
    }
  }

  const PoseMethod& method_;
  std::mt19937_64 random_;
  const ProgressCallback& progress_;
  Progress status_;
  FalseConfidence result_;
};

}  // namespace

void FalseConfidenceOptions::Check() const {
  if (pairs < 1) throw InvalidOption("different-objects", "must be positive", "name a number of pairs");
}

double FalseConfidence::ShareAbove(double limit) const {
  const auto above = std::ranges::count_if(confidences, [&](double confidence) { return confidence > limit; });
  return 100.0 * static_cast<double>(above) / static_cast<double>(std::max<std::size_t>(1, confidences.size()));
}

FalseConfidence MeasureFalseConfidence(const Dataset& dataset, const PoseMethod& method,
                                       const FalseConfidenceOptions& options, const ProgressCallback& progress) {
  options.Check();
  const std::size_t objects = dataset.ObjectCount();
  if (objects < 2)
    throw InvalidOption("different-objects", "needs two objects, the data set has " + std::to_string(objects));
  Measurement measurement(method, options, progress);
  const EvaluationScene first = dataset.Load(0);
  EvaluationScene reference = first;
  for (std::size_t i = 0; i < objects; ++i) {
    EvaluationScene query = i + 1 < objects ? dataset.Load(i + 1) : first;
    // Pairs k with floor(k objects / pairs) = i belong to object i.
    const auto pairs = static_cast<std::size_t>(options.pairs);
    for (std::size_t k = (i * pairs) / objects; k < ((i + 1) * pairs) / objects; ++k)
      measurement.Compare(reference, query);
    reference = std::move(query);
  }
  return measurement.Result();
}

}  // namespace antipode
