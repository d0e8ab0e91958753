#include "antipode/evaluation/prior_evaluation.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <Eigen/Dense>

#include "antipode/evaluation/object_protocol.h"
#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"

namespace antipode {
namespace {

constexpr double kCorrectDeg = 30;
constexpr double kDifferentObjectsWeight = 0.3;  // the least that keeps 95 % of them below a confidence of 0.5
constexpr double kTypicalScore = 10;

/// Mean negative log density of the true rotations at a temperature, against the uniform density.
double MeanNegativeLogDensity(const Eigen::MatrixXf& grid_scores, const Eigen::VectorXd& true_scores,
                              double temperature) {
  double sum = 0;
  for (Eigen::Index i = 0; i < true_scores.size(); ++i) {
    const Eigen::ArrayXd scaled = grid_scores.col(i).cast<double>().array() / temperature;
    const double best = scaled.maxCoeff();
    sum += best + std::log((scaled - best).exp().mean()) - true_scores[i] / temperature;
  }
  return sum / static_cast<double>(true_scores.size());
}

double FitTemperature(const RotationPosterior& posterior, const std::vector<ScoredPair>& pairs) {
  const auto count = static_cast<Eigen::Index>(pairs.size());
  Eigen::MatrixXf grid_scores(static_cast<Eigen::Index>(posterior.grid().size()), count);
  Eigen::VectorXd true_scores(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    grid_scores.col(i) = posterior.GridScores(pairs[i].correlation);
    true_scores[i] = posterior.Score(pairs[i].correlation, pairs[i].query_from_reference);
  }
  // The mean is smooth with one minimum in log temperature: shrink a bracket by the golden ratio.
  const double ratio = 0.5 * (std::sqrt(5.0) - 1);
  double low = std::log(0.1), high = std::log(10.0);
  const auto at = [&](double x) { return MeanNegativeLogDensity(grid_scores, true_scores, std::exp(x)); };
  double a = high - ratio * (high - low), b = low + ratio * (high - low);
  double at_a = at(a), at_b = at(b);
  while (high - low > 0.01) {
    if (at_a < at_b) {
      high = std::exchange(b, a);
      at_b = at_a;
      a = high - ratio * (high - low);
      at_a = at(a);
    } else {
      low = std::exchange(a, b);
      at_a = at_b;
      b = low + ratio * (high - low);
      at_b = at(b);
    }
  }
  return std::exp(0.5 * (low + high));
}

struct Outcome {
  RotationMode best;
  double correct = 0;  ///< 1 or 0
  double weight = 1;
};

/// Logistic regression by Newton's method, with a weak pull of the slope toward 1 and of the others
/// toward 0 so that few or separable outcomes have a solution.
void FitConfidence(const std::vector<Outcome>& outcomes, PriorCalibration& calibration) {
  constexpr double kPull = 1.0;
  const Eigen::Vector3d origin(1, 0, 0);
  Eigen::Vector3d parameters = origin;
  for (int step = 0; step < 50; ++step) {
    Eigen::Vector3d gradient = -kPull * (parameters - origin);
    Eigen::Matrix3d information = kPull * Eigen::Matrix3d::Identity();
    for (const Outcome& outcome : outcomes) {
      const Eigen::Vector3d features(LogOdds(outcome.best.probability), outcome.best.score / kTypicalScore, 1);
      const double probability = 1 / (1 + std::exp(-parameters.dot(features)));
      gradient += outcome.weight * (outcome.correct - probability) * features;
      information += outcome.weight * probability * (1 - probability) * features * features.transpose();
    }
    const Eigen::Vector3d move = information.ldlt().solve(gradient);
    parameters += move;
    if (move.norm() < 1e-9) break;
  }
  calibration.confidence_slope = parameters[0];
  calibration.confidence_score_weight = parameters[1] / kTypicalScore;
  calibration.confidence_offset = parameters[2];
}

}  // namespace

void ScoredPairs::Append(ScoredPairs more) {
  std::ranges::move(more.same_object, std::back_inserter(same_object));
  std::ranges::move(more.different_objects, std::back_inserter(different_objects));
}

ScoredPairs ScorePairs(const ObjectPrior& prior, const std::filesystem::path& objects, double in_plane_rotation_deg) {
  ObjectProtocolOptions protocol;
  protocol.in_plane_rotation_deg = in_plane_rotation_deg;
  ScoredPairs pairs;
  torch::Tensor reference_before;
  for (const auto& file : FilesWithExtension(objects, ".glb")) {
    std::vector<ObjectView> crops;
    std::vector<Eigen::Matrix3d> rotations;
    for (const ProtocolView& view :
         RenderProtocolViews(Renderer(LoadMesh(file)), file.stem().string(), protocol)) {
      crops.push_back(MakeObjectView(view.rendering.image, view.rendering.mask, view.camera,
                                     prior.ViewOptions()));
      rotations.push_back(crops.back().crop_from_camera * view.camera_from_object.rotation);
    }
    const auto codes = prior.Encode(crops);
    for (std::size_t i = 1; i < crops.size(); ++i) {
      const auto query = codes[static_cast<std::int64_t>(i)];
      pairs.same_object.push_back({prior.Correlation(codes[0], query), rotations[i] * rotations[0].transpose()});
      if (reference_before.defined()) pairs.different_objects.push_back(prior.Correlation(reference_before, query));
    }
    reference_before = codes[0];
  }
  return pairs;
}

RotationAccuracy MeasureAccuracy(const ObjectPrior& prior, const std::vector<ScoredPair>& pairs) {
  PosteriorOptions options;
  options.max_modes = 1;
  options.temperature = prior.calibration().temperature;
  RotationAccuracy accuracy;
  for (const ScoredPair& pair : pairs) {
    const RotationMode mode = prior.posterior().FindModes(pair.correlation, options).front();
    const double error = AngleBetweenDeg(mode.rotation, pair.query_from_reference);
    accuracy.within_15 += (error < 15) * 100.0 / pairs.size();
    accuracy.within_30 += (error < 30) * 100.0 / pairs.size();
  }
  return accuracy;
}

PriorCalibration FitCalibration(const RotationPosterior& posterior, const ScoredPairs& pairs) {
  if (pairs.same_object.empty()) throw Error("calibration", "there are no validation pairs");
  PriorCalibration calibration;
  calibration.temperature = FitTemperature(posterior, pairs.same_object);
  const PosteriorOptions options{.temperature = calibration.temperature};
  std::vector<Outcome> outcomes;
  for (const ScoredPair& pair : pairs.same_object) {
    const RotationMode mode = posterior.FindModes(pair.correlation, options).front();
    outcomes.push_back({mode, AngleBetweenDeg(mode.rotation, pair.query_from_reference) < kCorrectDeg ? 1.0 : 0.0});
  }
  for (const Eigen::VectorXf& correlation : pairs.different_objects)
    outcomes.push_back({posterior.FindModes(correlation, options).front(), 0, kDifferentObjectsWeight});
  FitConfidence(outcomes, calibration);
  return calibration;
}

}  // namespace antipode
