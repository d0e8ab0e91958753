#include "antipode/orientation/orientation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "antipode/geometry/rotation.h"
#include "antipode/nn/module_weights.h"
#include "antipode/util/error.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

constexpr char kPriorKey[] = "prior_sha256";
constexpr double kSmoothingPx = 0.3;  // of errors, when one is weighed against another

/// The four nearby views with what their synthesiser knows of its camera.
NearbyMatches MatchNearbyViews(const ViewSynthesizer& synthesizer, const Matcher& matcher, int& side) {
  std::vector<ViewRequest> requests;
  for (const RelativeView& relative : NearbyRequests(NearbyOrder::kElevationStage))
    requests.push_back({"nearby" + std::to_string(requests.size()), {}, relative});
  std::vector<cv::Mat> pictures;
  synthesizer.Synthesize(requests, [&](const SynthesizedView& view) { pictures.push_back(view.image); });
  side = pictures.front().cols;
  NearbyMatches matches;
  for (int first = 0; first < kNearbyViews; ++first) {
    for (int second = first + 1; second < kNearbyViews; ++second) {
      Correspondences pair = matcher.Match(pictures[first], pictures[second]);
      for (auto* points : {&pair.reference, &pair.query})
        for (Eigen::Vector2d& point : *points) point -= Eigen::Vector2d::Constant(0.5);  // centres at integers
      matches.Set(first, second, std::move(pair));
    }
  }
  return matches;
}

NearbyCameraModel ModelOf(const SynthesisCamera& camera, int side) {
  NearbyCameraModel model;
  model.focal_length = camera.focal_length * side;
  model.centre = 0.5 * side - 0.5;
  return model;
}

/// Scores of in-plane rotations, each computed once.
class InPlaneScores {
 public:
  InPlaneScores(const SynthesizerOfTurned& synthesizer, const Matcher& matcher, const ProgressCallback& progress)
      : synthesizer_(synthesizer), matcher_(matcher), progress_(progress) {}

  const ElevationEstimate& At(double in_plane_deg) {
    const auto found = estimates_.find(in_plane_deg);
    if (found != estimates_.end()) return found->second;
    if (progress_) progress_({"in-plane rotation", static_cast<std::int64_t>(estimates_.size()), 0, {}});
    ElevationEstimate estimate;
    try {
      estimate = EstimateElevation(*synthesizer_(in_plane_deg), matcher_);
    } catch (const Interrupted&) {
      throw;
    } catch (const Error&) {
      estimate.score = std::numeric_limits<double>::infinity();
    }
    return estimates_[in_plane_deg] = estimate;
  }

  double Best() const {
    return std::ranges::min_element(estimates_, {}, [](const auto& entry) { return entry.second.score; })->first;
  }

 private:
  const SynthesizerOfTurned& synthesizer_;
  const Matcher& matcher_;
  const ProgressCallback& progress_;
  std::map<double, ElevationEstimate> estimates_;
};

}  // namespace

Orientation OrientationFromUp(const Eigen::Vector3d& up, double certainty) {
  const double length = up.norm();
  if (!(length > 0)) return {};
  return {DegreesFromRadians(std::asin(std::clamp(-up.z() / length, -1.0, 1.0))), DegreesFromRadians(std::atan2(up.x(), -up.y())),
          certainty, "code"};
}

Eigen::Vector3d UpFromOrientation(const Orientation& orientation) {
  const double e = RadiansFromDegrees(orientation.elevation_deg), g = RadiansFromDegrees(orientation.in_plane_rotation_deg);
  return {std::sin(g) * std::cos(e), -std::cos(g) * std::cos(e), -std::sin(e)};
}

UprightReadoutImpl::UprightReadoutImpl(std::int64_t code_size, std::int64_t hidden)
    : hidden_(register_module("hidden", Dense(code_size, hidden))), up_(register_module("up", Dense(hidden, 4))) {}

UprightReadoutImpl::Output UprightReadoutImpl::forward(const torch::Tensor& codes) const {
  const auto output = up_->forward(at::gelu(hidden_->forward(codes)));
  const auto direction = output.slice(1, 0, 3);
  return {direction / direction.norm(2, 1, true).clamp_min(1e-6), output.select(1, 3)};
}

UprightEstimator UprightEstimator::Load(const std::string& model, const std::string& prior_sha256) {
  const TensorFile file = LoadModel(model);
  const auto prior = file.metadata.find(kPriorKey);
  if (prior == file.metadata.end() || prior->second != prior_sha256)
    throw BadFile(FindModel(model).file.string(), "belongs to another prior", "train it again: antipode train upright");
  const auto weight = file.tensors.find("hidden.weight");
  if (weight == file.tensors.end() || weight->second.shape.size() != 2) throw BadFile(model, "is no upright readout");
  UprightReadout readout(weight->second.shape[1], weight->second.shape[0]);
  LoadInto(*readout, file, model);
  return UprightEstimator(std::move(readout));
}

Orientation UprightEstimator::Estimate(const torch::Tensor& code) const {
  const torch::InferenceMode inference;
  const auto output = readout_->forward(code.flatten().unsqueeze(0));
  const auto up = output.up.to(torch::kDouble)[0];
  return OrientationFromUp({up[0].item<double>(), up[1].item<double>(), up[2].item<double>()},
                           torch::sigmoid(output.log_odds).item<double>());
}

void OrientationSearchOptions::Check() const {
  if (in_plane_rotations_deg.empty()) throw InvalidOption("in_plane_rotations", "are none", "give at least 0");
  if (!(finest_step_deg > 0)) throw InvalidOption("finest_step", "must be positive");
}

ElevationEstimate EstimateElevation(const ViewSynthesizer& synthesizer, const Matcher& matcher, const ProgressCallback& progress) {
  if (progress) progress({"nearby views", 0, 0, {}});
  int side = 0;
  const NearbyMatches matches = MatchNearbyViews(synthesizer, matcher, side);
  return SearchElevation(matches, NearbyOrder::kElevationStage, ModelOf(synthesizer.Camera(), side));
}

Orientation SearchOrientation(const SynthesizerOfTurned& synthesizer, const Matcher& matcher, const OrientationSearchOptions& options,
                              const ProgressCallback& progress) {
  options.Check();
  InPlaneScores scores(synthesizer, matcher, progress);
  for (const double angle : options.in_plane_rotations_deg) scores.At(angle);
  double best = scores.Best();
  double runner_up = std::numeric_limits<double>::infinity();
  for (const double angle : options.in_plane_rotations_deg)
    if (angle != best) runner_up = std::min(runner_up, scores.At(angle).score);
  const double best_coarse = scores.At(best).score;
  if (!std::isfinite(best_coarse))
    throw Error("orientation", "the nearby views have too few matches", "give --elevation and --in-plane-rotation, or another --matcher");
  Orientation result{0, best, 0, "search"};
  if (options.in_plane_rotations_deg.size() > 1) {
    double step = 0.5 * std::abs(options.in_plane_rotations_deg[1] - options.in_plane_rotations_deg[0]);
    for (;; step /= 2) {
      scores.At(best - step);
      scores.At(best + step);
      best = scores.Best();
      if (step <= options.finest_step_deg) break;
    }
    const double before = scores.At(best - step).score, at = scores.At(best).score, after = scores.At(best + step).score;
    result.in_plane_rotation_deg = best + step * ParabolaOffset(before, at, after);
  }
  result.elevation_deg = scores.At(best).elevation_deg;
  result.certainty = std::isfinite(runner_up) ? std::max(0.0, 1 - (best_coarse + kSmoothingPx) / (runner_up + kSmoothingPx)) : 1;
  return result;
}

}  // namespace antipode
