#include "antipode/pose/object_pose.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"
#include "antipode/util/stopwatch.h"

namespace antipode {
namespace {

constexpr double kSameModeDeg = 30;
constexpr double kInlierPower = 0.5;           // a mode is worth its probability times (1 + inliers) to this power
constexpr double kLeastProbability = 1e-4;     // of a mode, so that matches can speak for any
constexpr double kFlatPosterior = 0.3;         // mass of all modes together
constexpr char kOfMatches[] = "matching";
constexpr std::size_t kMostRefined = 4;        // two tenths of a second each
constexpr double kWorthRefining = 0.1;         // of what the best one is worth
constexpr double kConfirmedDeg = 12;           // the refiner's errors are about 5, those of right matches about 1
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
  std::string source;

  double Worth() const {
    return std::max(mode.probability, kLeastProbability) * std::pow(1.0 + geometry.inliers, kInlierPower);
  }
};

/// Matches the query with the view nearest to a mode, from the rotation that the mode says.
VerifiedMode Verify(const RotationMode& mode, const Reference& reference, const Matcher& matcher, const ObjectView& crop,
                    const std::string& source, ViewMatchingOptions options) {
  const std::size_t view = NearestView(reference, mode.rotation);
  const Eigen::Matrix3d query_from_view = mode.rotation * reference.CropRotation(view).transpose();
  options.quarter_turns = {QuarterTurnsUndoing(query_from_view)};
  options.starts = {query_from_view};
  const MatchedViews matched = MatchObjectViews(matcher, reference.crops[view], crop, options);
  VerifiedMode verified{mode, {}, mode.rotation, source};
  std::vector<TwoViewGeometry> explanations = matched.alternatives;
  explanations.push_back(matched.geometry);
  for (const TwoViewGeometry& geometry : explanations) {
    if (geometry.status == TwoViewStatus::kTooFewMatches || geometry.inliers <= verified.geometry.inliers) continue;
    const Eigen::Matrix3d rotation = geometry.query_from_reference.rotation * reference.CropRotation(view);
    if (AngleBetweenDeg(rotation, mode.rotation) > kSameModeDeg) continue;
    verified.geometry = geometry;
    const bool is_refined = geometry.inliers >= kInliersToRefine && geometry.RotationDeviationDeg() < kDeviationToRefineDeg;
    verified.refined = is_refined ? rotation : mode.rotation;
    verified.source = is_refined ? kOfMatches : source;
  }
  return verified;
}

Rigid3 CameraPose(const ObjectView& crop, const Rigid3& crop_from_object) {
  return Rigid3{crop.crop_from_camera.transpose(), Eigen::Vector3d::Zero()} * crop_from_object;
}

/// How often the best hypothesis is right: a logistic function of its share and its inliers, fitted on validation objects.
double ConfidenceOf(double share, int inliers) {
  const double log_odds = kConfidence.constant + kConfidence.share * LogOdds(share) + kConfidence.inliers * std::log1p(inliers);
  return Logistic(log_odds);
}

/// The selector's views, or the prior's modes.
std::vector<VerifiedMode> CoarseModes(const Reference& reference, const ObjectPoseModels& models, const ObjectView& view,
                                      const ObjectView& large, int count) {
  std::vector<VerifiedMode> modes;
  if (models.comparison != nullptr && models.comparison->Selects()) {
    for (const auto& selection : models.comparison->Select(large, static_cast<std::size_t>(count)))
      modes.push_back({{selection.crop_from_object.rotation, selection.probability, 0}, {}, selection.crop_from_object.rotation, "selector"});
    return modes;
  }
  const torch::Tensor code = models.prior->Encode(std::span(&view, 1))[0];
  for (const RotationMode& mode : models.prior->CompareWithJoined(reference.code, code, {.max_modes = count}))
    modes.push_back({mode, {}, mode.rotation, "prior"});
  return modes;
}

/// Refines the first poses, the best ones. A rotation of the matches stays where the refiner nearly confirms it.
void RefineBest(ViewComparison& comparison, const ObjectView& large, int iterations, std::vector<VerifiedMode>& modes, std::vector<Rigid3>& poses) {
  std::vector<Rigid3> best;
  for (std::size_t i = 0; i < std::min(poses.size(), kMostRefined); ++i)
    if (modes[i].Worth() >= kWorthRefining * modes.front().Worth()) best.push_back(poses[i]);
  const auto histories = comparison.Refine(large, best, iterations);
  for (std::size_t i = 0; i < best.size(); ++i) {
    const Rigid3& refined = histories[i].back();
    const bool is_confirmed = modes[i].source == kOfMatches && AngleBetweenDeg(refined.rotation, poses[i].rotation) < kConfirmedDeg;
    poses[i].translation = refined.translation;
    if (is_confirmed) continue;
    poses[i].rotation = refined.rotation;
    modes[i].source = "refiner";
  }
}

/// Whether there is something to refine with; a reference that does not suit it is a warning.
bool Refines(const Reference& reference, const ObjectPoseModels& models, const ObjectPoseOptions& options, ObjectPose& result) {
  if (models.comparison == nullptr || !models.comparison->Refines() || options.refine_iterations < 1) return false;
  if (reference.views.size() >= static_cast<std::size_t>(options.least_views_to_refine)) return true;
  result.warnings.push_back("the refiner was left out: the reference has only " + std::to_string(reference.views.size()) +
                            " views, it needs " + std::to_string(options.least_views_to_refine));
  return false;
}

void AddHypotheses(const Reference& reference, std::vector<VerifiedMode> modes, const ObjectPoseModels& models,
                   const ObjectView& large, const ObjectPoseOptions& options, ObjectPose& result) {
  std::ranges::stable_sort(modes, std::ranges::greater(), &VerifiedMode::Worth);
  double worth = 0, probability = 0;
  std::vector<Rigid3> poses;
  for (const VerifiedMode& mode : modes) {
    worth += mode.Worth();
    probability += mode.mode.probability;
    poses.push_back(PlaceObject(reference, result.view, mode.refined));
  }
  if (Refines(reference, models, options, result)) RefineBest(*models.comparison, large, options.refine_iterations, modes, poses);
  const int inliers = modes.front().geometry.inliers;
  result.confidence = ConfidenceOf(modes.front().Worth() / worth, inliers);
  if (std::min(1.0, probability) < kFlatPosterior && inliers < kInliersToRefine)
    result.warnings.emplace_back("the object looks alike from many sides, or is another one than the reference: the rotation is uncertain");
  // Matches can make a mode sure that a flat posterior gave little.
  const double that_one_is_right = std::max(std::min(1.0, probability), result.confidence);
  for (std::size_t i = 0; i < modes.size(); ++i)
    result.hypotheses.push_back({CameraPose(result.view, poses[i]), that_one_is_right * modes[i].Worth() / worth, modes[i].source});
  result.evidence["inliers"] = inliers;
}

}  // namespace

void ObjectPoseOptions::Check() const {
  if (hypotheses < 1 || hypotheses > 50) throw InvalidOption("hypotheses", "is " + std::to_string(hypotheses), "use 1 to 50");
  if (refine_iterations < 0 || refine_iterations > 100)
    throw InvalidOption("refine_iterations", "is " + std::to_string(refine_iterations), "use 0 to 100");
  if (least_views_to_refine < 0) throw InvalidOption("least_views_to_refine", "must not be negative");
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

ObjectPose EstimateObjectPose(const Reference& reference, const ObjectPoseModels& models, const ObjectPhotograph& photograph,
                              const ObjectPoseOptions& options) {
  options.Check();
  ObjectPose result;
  Stopwatch stopwatch;
  result.view = MakeObjectView(photograph.image, photograph.mask, photograph.camera, models.prior->ViewOptions());
  const ObjectView large =
      MakeObjectView(photograph.image, photograph.mask, photograph.camera, {.size = reference.crops.front().image.cols});
  result.warnings = result.view.warnings;
  std::vector<VerifiedMode> modes = CoarseModes(reference, models, result.view, large, options.hypotheses);
  result.timings_s["compare"] = stopwatch.Lap();

  if (models.matcher != nullptr) {
    for (VerifiedMode& mode : modes) mode = Verify(mode.mode, reference, *models.matcher, large, mode.source, options.matching);
    result.timings_s["match"] = stopwatch.Lap();
  }
  AddHypotheses(reference, std::move(modes), models, large, options, result);
  result.timings_s["refine"] = stopwatch.Lap();
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
