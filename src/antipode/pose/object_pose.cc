#include "antipode/pose/object_pose.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kSameModeDeg = 30;
constexpr double kInlierPower = 0.5;           // a mode is worth its probability times (1 + inliers) to this power
constexpr double kLeastProbability = 1e-4;     // of a mode, so that matches can speak for any
constexpr int kInliersToRefine = 50;
constexpr double kDeviationToRefineDeg = 1;

struct ConfidenceWeights {
  double constant, share, inliers;
};
constexpr ConfidenceWeights kConfidence{-0.453, 0.564, 0.650};

/// A mode with what matching says of it.
struct VerifiedMode {
  RotationMode mode;  ///< crop_from_object
  TwoViewGeometry geometry;
  Eigen::Matrix3d refined;  ///< the rotation of the matches, where they determine it
  bool is_refined = false;

  double Worth() const {
    return std::max(mode.probability, kLeastProbability) * std::pow(1.0 + geometry.inliers, kInlierPower);
  }
};

/// Matches the query with the view nearest to a mode, from the rotation that the mode says.
VerifiedMode Verify(const RotationMode& mode, const Reference& reference, const Matcher& matcher, const ObjectView& crop,
                    ViewMatchingOptions options) {
  const std::size_t view = NearestView(reference, mode.rotation);
  const Eigen::Matrix3d query_from_view = mode.rotation * reference.CropRotation(view).transpose();
  options.quarter_turns = {QuarterTurnsUndoing(query_from_view)};
  options.starts = {query_from_view};
  const MatchedViews matched = MatchObjectViews(matcher, reference.crops[view], crop, options);
  VerifiedMode verified{mode, {}, mode.rotation};
  std::vector<TwoViewGeometry> explanations = matched.alternatives;
  explanations.push_back(matched.geometry);
  for (const TwoViewGeometry& geometry : explanations) {
    if (geometry.status == TwoViewStatus::kTooFewMatches || geometry.inliers <= verified.geometry.inliers) continue;
    const Eigen::Matrix3d rotation = geometry.query_from_reference.rotation * reference.CropRotation(view);
    if (AngleBetweenDeg(rotation, mode.rotation) > kSameModeDeg) continue;
    verified.geometry = geometry;
    verified.is_refined = geometry.inliers >= kInliersToRefine && geometry.RotationDeviationDeg() < kDeviationToRefineDeg;
    verified.refined = verified.is_refined ? rotation : mode.rotation;
  }
  return verified;
}

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Rigid3 CameraPose(const ObjectView& crop, const Rigid3& crop_from_object) {
  return Rigid3{crop.crop_from_camera.transpose(), Eigen::Vector3d::Zero()} * crop_from_object;
}

/// How often the best hypothesis is right: a logistic function of its share and its inliers, fitted on validation objects.
double ConfidenceOf(double share, int inliers) {
  const double log_odds = kConfidence.constant + kConfidence.share * LogOdds(share) + kConfidence.inliers * std::log1p(inliers);
  return 1 / (1 + std::exp(-log_odds));
}

void AddHypotheses(const Reference& reference, std::vector<VerifiedMode> modes, ObjectPose& result) {
  std::ranges::stable_sort(modes, std::ranges::greater(), &VerifiedMode::Worth);
  double worth = 0, probability = 0;
  for (const VerifiedMode& mode : modes) {
    worth += mode.Worth();
    probability += mode.mode.probability;
  }
  for (const VerifiedMode& mode : modes)
    result.hypotheses.push_back({CameraPose(result.view, PlaceObject(reference, result.view, mode.refined)),
                                 std::min(1.0, probability) * mode.Worth() / worth, mode.is_refined ? "matching" : "prior"});
  const int inliers = modes.front().geometry.inliers;
  result.confidence = ConfidenceOf(modes.front().Worth() / worth, inliers);
  result.evidence["inliers"] = inliers;
}

}  // namespace

void ObjectPoseOptions::Check() const {
  if (hypotheses < 1 || hypotheses > 50) throw InvalidOption("hypotheses", "is " + std::to_string(hypotheses), "use 1 to 50");
  matching.Check();
}

std::size_t NearestView(const Reference& reference, const Eigen::Matrix3d& camera_from_object) {
  const auto direction = [&](std::size_t i) { return reference.CropRotation(i).row(2).dot(camera_from_object.row(2)); };
  std::size_t best = 0;
  for (std::size_t i = 1; i < reference.views.size(); ++i)
    if (direction(i) > direction(best)) best = i;
  return best;
}

Rigid3 PlaceObject(const Reference& reference, const ObjectView& crop, const Eigen::Matrix3d& crop_from_object) {
  const std::size_t nearest = NearestView(reference, crop_from_object);
  const ObjectView& view = reference.crops[nearest];
  const Rigid3& pose = reference.views[nearest].camera_from_object;
  const Eigen::Vector3d centre = view.crop_from_camera * pose.translation;  // in the view's crop camera
  // Both crops are cut to the object's box, so a length that spans the same share of them is at a distance in proportion.
  const double distance = centre.z() * crop.distance / view.distance;
  const Eigen::Matrix3d crop_from_view = crop_from_object * reference.CropRotation(nearest).transpose();
  const double in_plane = std::atan2(crop_from_view(1, 0) - crop_from_view(0, 1), crop_from_view(0, 0) + crop_from_view(1, 1));
  const Eigen::Vector2d beside = Eigen::Rotation2Dd(in_plane) * centre.head<2>();
  return {crop_from_object, {beside.x(), beside.y(), distance}};
}

ObjectPose EstimateObjectPose(const Reference& reference, const ObjectPrior& prior, const Matcher* matcher,
                              const ObjectPhotograph& photograph, const ObjectPoseOptions& options) {
  options.Check();
  ObjectPose result;
  auto start = std::chrono::steady_clock::now();
  result.view = MakeObjectView(photograph.image, photograph.mask, photograph.camera, prior.ViewOptions());
  result.warnings = result.view.warnings;
  const torch::Tensor code = prior.Encode(std::span(&result.view, 1))[0];
  std::vector<VerifiedMode> modes;
  for (const RotationMode& mode : prior.Compare(reference.code, code, {.max_modes = options.hypotheses}))
    modes.push_back({mode, {}, mode.rotation});
  result.timings_s["compare"] = SecondsSince(start);

  if (matcher != nullptr) {
    start = std::chrono::steady_clock::now();
    const ObjectView crop = MakeObjectView(photograph.image, photograph.mask, photograph.camera, {.size = reference.crops.front().image.cols});
    for (VerifiedMode& mode : modes) mode = Verify(mode.mode, reference, *matcher, crop, options.matching);
    result.timings_s["match"] = SecondsSince(start);
  }
  AddHypotheses(reference, std::move(modes), result);
  return result;
}

TwoViewPose RelativeToSource(const Reference& reference, ObjectPose query) {
  const Rigid3 object_from_source = reference.source_from_object ? reference.source_from_object->Inverse() : Rigid3();
  TwoViewPose result;
  for (const ObjectPoseHypothesis& hypothesis : query.hypotheses)
    result.hypotheses.push_back({hypothesis.camera_from_object * object_from_source, hypothesis.probability, hypothesis.source});
  result.query_from_reference = result.hypotheses.front().query_from_reference;
  result.confidence = query.confidence;
  result.timings_s = std::move(query.timings_s);
  result.evidence = std::move(query.evidence);
  for (const std::string& warning : query.warnings) result.warnings.push_back("query: " + warning);
  result.query = std::move(query.view);
  return result;
}

TwoViewPose ComposeObjectPoses(ObjectPose reference, ObjectPose query) {
  Reference known;
  known.source_from_object = reference.hypotheses.front().camera_from_object;
  TwoViewPose result = RelativeToSource(known, std::move(query));
  for (PoseHypothesis& hypothesis : result.hypotheses) hypothesis.probability *= reference.hypotheses.front().probability;
  result.confidence *= reference.confidence;
  for (const auto& [stage, seconds] : reference.timings_s) result.timings_s[stage] += seconds;
  for (const std::string& warning : reference.warnings) result.warnings.push_back("reference: " + warning);
  result.reference = std::move(reference.view);
  return result;
}

}  // namespace antipode
