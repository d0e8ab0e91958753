#include "antipode/evaluation/prior_evaluation.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <Eigen/Dense>

#include "antipode/evaluation/object_protocol.h"
#include "antipode/geometry/rotation.h"
#include "antipode/render/mesh_collection.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/weights/registry.h"

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

double FitTemperature(const ObjectPrior& prior, const std::vector<CodedPair>& pairs) {
  const RotationPosterior& posterior = prior.posterior();
  const auto count = static_cast<Eigen::Index>(pairs.size());
  Eigen::MatrixXf grid_scores(static_cast<Eigen::Index>(posterior.grid().size()), count);
  Eigen::VectorXd true_scores(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::VectorXf correlation = prior.Correlation(pairs[i].reference, pairs[i].query);
    grid_scores.col(i) = posterior.GridScores(correlation);
    true_scores[i] = posterior.Score(correlation, pairs[i].query_from_reference);
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

/// The modes of a pair, and which of them is the truth.
struct JudgedModes {
  std::vector<RotationMode> modes;
  std::size_t truth = 0;
};

/// Pairs of which some mode is right.
std::vector<JudgedModes> Judge(const std::vector<std::vector<RotationMode>>& modes, const std::vector<CodedPair>& pairs) {
  std::vector<JudgedModes> judged;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto error = [&](const RotationMode& mode) { return AngleBetweenDeg(mode.rotation, pairs[i].query_from_reference); };
    const auto nearest = std::ranges::min_element(modes[i], {}, error);
    if (error(*nearest) < kCorrectDeg) judged.push_back({modes[i], static_cast<std::size_t>(nearest - modes[i].begin())});
  }
  return judged;
}

/// Conditional logistic regression by Newton's method, with a weak pull of both weights toward 1.
void FitModeWeights(const std::vector<JudgedModes>& pairs, PriorCalibration& calibration) {
  constexpr double kPull = 1.0;
  Eigen::Vector2d weights = Eigen::Vector2d::Ones();
  for (int step = 0; step < 50; ++step) {
    Eigen::Vector2d gradient = -kPull * (weights - Eigen::Vector2d::Ones());
    Eigen::Matrix2d information = kPull * Eigen::Matrix2d::Identity();
    for (const JudgedModes& pair : pairs) {
      Eigen::MatrixX2d features(static_cast<Eigen::Index>(pair.modes.size()), 2);
      for (Eigen::Index k = 0; k < features.rows(); ++k)
        features.row(k) << LogProbability(pair.modes[k]), pair.modes[k].log_weight;
      Eigen::VectorXd share = features * weights;
      share = (share.array() - share.maxCoeff()).exp();
      share /= share.sum();
      const Eigen::Vector2d mean = features.transpose() * share;
      gradient += features.row(static_cast<Eigen::Index>(pair.truth)).transpose() - mean;
      information += features.transpose() * share.asDiagonal() * features - mean * mean.transpose();
    }
    const Eigen::Vector2d move = information.ldlt().solve(gradient);
    weights += move;
    if (move.norm() < 1e-9) break;
  }
  calibration.mode_weight = weights[0];
  calibration.ranker_weight = weights[1];
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
      const double probability = Logistic(parameters.dot(features));
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

void CodedPairs::Append(CodedPairs more) {
  std::ranges::move(more.same_object, std::back_inserter(same_object));
  std::ranges::move(more.different_objects, std::back_inserter(different_objects));
}

CodedPairs EncodePairs(const ObjectPrior& prior, const std::filesystem::path& objects, double in_plane_rotation_deg) {
  ObjectProtocolOptions protocol;
  protocol.in_plane_rotation_deg = in_plane_rotation_deg;
  CodedPairs pairs;
  torch::Tensor reference_before;
  const MeshCollection meshes = MeshCollection::Open(objects);
  for (std::size_t object = 0; object < meshes.size(); ++object) {
    const std::string name = std::filesystem::path(meshes.Name(object)).stem().string();
    std::vector<ObjectView> crops;
    std::vector<Eigen::Matrix3d> rotations;
    for (const ProtocolView& view : RenderProtocolViews(Renderer(meshes.Load(object)), name, protocol)) {
      crops.push_back(MakeObjectView(view.rendering.image, view.rendering.mask, view.camera,
                                     prior.ViewOptions()));
      rotations.push_back(crops.back().crop_from_camera * view.camera_from_object.rotation);
    }
    const auto codes = prior.Encode(crops);
    for (std::size_t i = 1; i < crops.size(); ++i) {
      const auto query = codes[static_cast<std::int64_t>(i)];
      pairs.same_object.push_back({codes[0], query, rotations[i] * rotations[0].transpose()});
      if (reference_before.defined()) pairs.different_objects.push_back({reference_before, query});
    }
    reference_before = codes[0];
  }
  return pairs;
}

RotationAccuracy MeasureAccuracy(const ObjectPrior& prior, const std::vector<CodedPair>& pairs) {
  RotationAccuracy accuracy;
  for (const CodedPair& pair : pairs) {
    const RotationMode mode = prior.Compare(pair.reference, pair.query, {.max_modes = 1}).front();
    const double error = AngleBetweenDeg(mode.rotation, pair.query_from_reference);
    accuracy.within_15 += (error < 15) * 100.0 / pairs.size();
    accuracy.within_30 += (error < 30) * 100.0 / pairs.size();
  }
  return accuracy;
}

PriorCalibration FitCalibration(const ObjectPrior& prior, const CodedPairs& pairs) {
  if (pairs.same_object.empty()) throw Error("calibration", "there are no validation pairs");
  PriorCalibration calibration;
  calibration.temperature = FitTemperature(prior, pairs.same_object);
  const auto modes_of = [&](const std::vector<CodedPair>& of) {
    std::vector<std::vector<RotationMode>> modes;
    for (const CodedPair& pair : of) modes.push_back(prior.Hypotheses(pair.reference, pair.query, {.temperature = calibration.temperature}));
    return modes;
  };
  std::vector<std::vector<RotationMode>> same = modes_of(pairs.same_object), different = modes_of(pairs.different_objects);
  if (prior.HasSecondStage()) FitModeWeights(Judge(same, pairs.same_object), calibration);
  const auto best_of = [&](std::vector<RotationMode>& modes) {
    Reweigh(modes, calibration);
    return modes.front();
  };
  std::vector<Outcome> outcomes;
  for (std::size_t i = 0; i < same.size(); ++i) {
    const RotationMode mode = best_of(same[i]);
    outcomes.push_back({mode, AngleBetweenDeg(mode.rotation, pairs.same_object[i].query_from_reference) < kCorrectDeg ? 1.0 : 0.0});
  }
  for (std::vector<RotationMode>& modes : different) outcomes.push_back({best_of(modes), 0, kDifferentObjectsWeight});
  FitConfidence(outcomes, calibration);
  return calibration;
}

void CalibrateModel(const std::filesystem::path& folder, const std::filesystem::path& objects) {
  const ObjectPrior prior = ObjectPrior::Load(folder.string());
  CodedPairs pairs = EncodePairs(prior, objects, 0);
  pairs.Append(EncodePairs(prior, objects, 45));
  TensorFile file = LoadModel(folder.string());
  for (const auto& [key, value] : FitCalibration(prior, pairs).ToMetadata()) file.metadata[key] = value;
  const ModelEntry entry = FindModel(folder.string());
  SaveModel(folder.parent_path(), folder.filename().string(), file, entry.description, entry.licence, ReadFile(folder / "card.md"));
}

}  // namespace antipode
