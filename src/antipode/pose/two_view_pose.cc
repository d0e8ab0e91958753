#include "antipode/pose/two_view_pose.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "antipode/geometry/rotation.h"
#include "antipode/pose/halfway_matching.h"
#include "antipode/pose/joint_posterior.h"
#include "antipode/util/error.h"
#include "antipode/util/stopwatch.h"

namespace antipode {
namespace {

constexpr double kTrustedDirectionDeg = 10;  // of the translation, by the covariance
constexpr double kTurnWorthTrying = 0.1;  // posterior mass; at least one of four quarter turns has more

constexpr std::size_t kLeastMatches = 8;  // fewer are chance

/// Printed by scripts/fit_confidence.py.
struct MatchingWeights {
  double constant, inliers, share, deviation, disagreement;
};
constexpr MatchingWeights kMatching{-5.465, 1.655, 0.107, -0.485, -0.817};
constexpr double kTiny = 1e-300;
constexpr double kTruthIsAmongOthers = 0.74;  // if the first of several hypotheses is wrong, on validation objects
/// Fitted on validation objects, level and rolled, and pairs of different ones.
struct JointWeights {
  double constant, share, prior, by_itself;
};
constexpr JointWeights kJoint{0.59, 0.76, 0.91, -0.91};
constexpr double kTellingSupport = 10;  // with so much support of the matches the prior's own confidence counts 1/e
constexpr double kLeastShare = 1e-2;    // shares of nearly 0 or 1 are not to be believed

void AddWarnings(const std::string& whose, const std::vector<std::string>& from,
                 std::vector<std::string>& to) {
  for (const std::string& warning : from) to.push_back(whose + ": " + warning);
}

using CroppedPair = std::array<ObjectView, 2>;  // reference, query

CroppedPair Crop(const ObjectPhotograph& reference, const ObjectPhotograph& query, const ObjectViewOptions& options) {
  return {MakeObjectView(reference.image, reference.mask, reference.camera, options),
          MakeObjectView(query.image, query.mask, query.camera, options)};
}

void Keep(CroppedPair views, TwoViewPose& result) {
  AddWarnings("reference", views[0].warnings, result.warnings);
  AddWarnings("query", views[1].warnings, result.warnings);
  result.reference = std::move(views[0]);
  result.query = std::move(views[1]);
}

struct PriorOpinion {
  torch::Tensor codes;
  std::vector<RotationMode> weighed;  ///< all that were weighed
  std::vector<RotationMode> modes;    ///< of them, the ones worth reporting
};

PriorOpinion AskPrior(const ObjectPrior& prior, const CroppedPair& views, const TwoViewPoseOptions& options, TwoViewPose& result) {
  Stopwatch stopwatch;
  PriorOpinion opinion{prior.Encode(views), {}, {}};
  result.timings_s["encode"] = stopwatch.Lap();
  const PosteriorOptions reported{.max_modes = options.hypotheses};
  opinion.modes = opinion.weighed = prior.WeighedModes(opinion.codes[0], opinion.codes[1], reported, options.roll);
  KeepReportable(opinion.modes, reported);
  result.timings_s["compare"] = stopwatch.Lap();
  return opinion;
}

MatchedViews Match(const Matcher& matcher, const CroppedPair& views, const ViewMatchingOptions& options,
                   TwoViewPose& result) {
  Stopwatch stopwatch;
  MatchedViews matched = MatchObjectViews(matcher, views[0], views[1], options);
  result.timings_s["match"] = stopwatch.Lap();
  result.evidence["matches"] = static_cast<double>(matched.correspondences.size());
  result.evidence["inliers"] = matched.geometry.inliers;
  return matched;
}

/// The translation of the crops, turned where the correspondences know its direction better.
Rigid3 ComposeFromMatches(const CroppedPair& views, const TwoViewGeometry& geometry) {
  Rigid3 pose = ComposeFromCrops(views[0], views[1], geometry.query_from_reference.rotation);
  const double deviation = DegreesFromRadians(std::sqrt(geometry.covariance.bottomRightCorner<2, 2>().trace() / 2));
  if (geometry.status == TwoViewStatus::kFound && deviation < kTrustedDirectionDeg)
    pose.translation = BetweenCameras(views[0], views[1], geometry.query_from_reference).translation * pose.translation.norm();
  return pose;
}

double TranslationDisagreementDeg(const CroppedPair& views, const Rigid3& between_crops) {
  const Eigen::Vector3d of_crops = ComposeFromCrops(views[0], views[1], between_crops.rotation).translation;
  const Eigen::Vector3d of_matches = BetweenCameras(views[0], views[1], between_crops).translation;
  return DegreesFromRadians(std::atan2(of_matches.cross(of_crops).norm(), of_matches.dot(of_crops)));
}

/// One explanation of the matches, and how likely it is right.
struct WeighedPose {
  TwoViewGeometry geometry;
  MatchingEvidence evidence;
  double probability = 0;
};

WeighedPose Weigh(const CroppedPair& views, const MatchedViews& matched, const TwoViewGeometry& geometry) {
  WeighedPose weighed{geometry, {}, 0};
  weighed.evidence = {static_cast<int>(matched.correspondences.size()), geometry.inliers,
                      std::min(geometry.RotationDeviationDeg(), 180.0),
                      TranslationDisagreementDeg(views, geometry.query_from_reference)};
  weighed.probability = MatchingProbability(weighed.evidence);
  return weighed;
}

/// Of all explanations of the matches the most probable.
WeighedPose MostProbable(const CroppedPair& views, const MatchedViews& matched) {
  WeighedPose best = Weigh(views, matched, matched.geometry);
  for (const TwoViewGeometry& alternative : matched.alternatives) {
    WeighedPose other = Weigh(views, matched, alternative);
    if (other.probability > best.probability) best = std::move(other);
  }
  return best;
}

void File(const WeighedPose& weighed, TwoViewPose& result) {
  const MatchingEvidence& evidence = weighed.evidence;
  result.evidence["inliers"] = evidence.inliers;
  result.evidence["rotation_deviation_deg"] = evidence.rotation_deviation_deg;
  result.evidence["translation_disagreement_deg"] = evidence.translation_disagreement_deg;
}

/// Of a result that is the pose of matching.
void WarnOfDegeneracy(TwoViewStatus status, TwoViewPose& result) {
  if (status == TwoViewStatus::kPlanar)
    result.warnings.emplace_back("matching: all matches lie on one plane, the pose may be its mirror solution");
  if (status == TwoViewStatus::kPureRotation)
    result.warnings.emplace_back("matching: the matches show no parallax, the translation is that of the crops");
}

/// The turns of the query that bring it upright with some probability, likeliest first.
std::vector<int> TurnsSuggestedBy(const GridPosterior& prior) {
  std::array<double, 4> mass{};
  for (std::size_t g = 0; g < prior.rotations.size(); ++g)
    mass[QuarterTurnsUndoing(prior.rotations[g])] += prior.weights[static_cast<Eigen::Index>(g)];
  std::vector<int> turns;
  for (int turn = 0; turn < 4; ++turn)
    if (mass[turn] >= kTurnWorthTrying) turns.push_back(turn);
  std::ranges::sort(turns, [&](int a, int b) { return mass[a] > mass[b]; });
  return turns;
}

/// The prior's modes and what the matches make of them, weighed together; then each by matches that are found under it.
std::vector<JointHypothesis> WeighTogether(const Matcher& matcher, const CroppedPair& views, const MatchedViews& matched,
                                           const PriorOpinion& opinion, const GridPosterior& posterior, TwoViewPose& result) {
  Stopwatch stopwatch;
  const CentredCameras cameras{{views[0].camera, views[1].camera}, views[0].distance, views[1].distance};
  const bool is_chance = matched.correspondences.size() < kLeastMatches;
  std::vector<Eigen::Matrix3d> further_starts;
  if (matched.geometry.status != TwoViewStatus::kTooFewMatches)
    further_starts.push_back(matched.geometry.query_from_reference.rotation);
  const CentredGeometry matches(is_chance ? Correspondences{} : matched.correspondences, cameras);
  const std::vector<JointHypothesis> joint = WeighTogether(matches, posterior, opinion.weighed, further_starts);
  result.timings_s["weigh"] = stopwatch.Lap();
  const auto match = [&](const Eigen::Matrix3d& rotation) { return MatchHalfway(matcher, views[0], views[1], rotation); };
  const std::vector<JointHypothesis> weighed = WeighByOwnMatches(joint, posterior, cameras, match, {.least_matches = kLeastMatches});
  result.timings_s["rematch"] = stopwatch.Lap();
  return weighed;
}

/// The first is right with `confidence`; the others share most of the rest by the roots of their shares, none more than it.
std::vector<double> Probabilities(const std::vector<JointHypothesis>& joint, double confidence) {
  double sum = 0;
  for (std::size_t i = 1; i < joint.size(); ++i) sum += std::sqrt(joint[i].share);
  std::vector<double> probabilities{confidence};
  for (std::size_t i = 1; i < joint.size(); ++i)
    probabilities.push_back(std::min(confidence, (1 - confidence) * kTruthIsAmongOthers * std::sqrt(joint[i].share) / std::max(sum, kTiny)));
  return probabilities;
}

/// Hypotheses, confidence and evidence of the result.
void Take(const std::vector<JointHypothesis>& joint, const CroppedPair& views, double confidence, int most, TwoViewPose& result) {
  const JointHypothesis& best = joint.front();
  result.confidence = confidence;
  result.evidence["support"] = best.support;
  result.evidence["share"] = best.share;
  result.evidence["prior_mass"] = best.prior_mass;
  const std::vector<double> probabilities = Probabilities(joint, confidence);
  for (std::size_t i = 0; i < joint.size() && i < static_cast<std::size_t>(most); ++i)
    result.hypotheses.push_back({BetweenCameras(views[0], views[1], joint[i].query_crop_from_reference_crop), probabilities[i],
                                 joint[i].is_refined ? "matching" : "prior"});
}

}  // namespace

void TwoViewPoseOptions::Check() const {
  if (hypotheses < 1 || hypotheses > 50)
    throw InvalidOption("hypotheses", "is " + std::to_string(hypotheses), "use 1 to 50");
  if (matching_size < 64 || matching_size > 2048)
    throw InvalidOption("matching_size", "is " + std::to_string(matching_size), "use 64 to 2048");
  matching.Check();
}

TwoViewPose EstimatePose(const ObjectPrior& prior, const ObjectPhotograph& reference,
                         const ObjectPhotograph& query, const TwoViewPoseOptions& options) {
  options.Check();
  TwoViewPose result;
  Stopwatch stopwatch;
  CroppedPair views = Crop(reference, query, prior.ViewOptions());
  result.timings_s["crop"] = stopwatch.Lap();
  const PriorOpinion opinion = AskPrior(prior, views, options, result);
  for (const RotationMode& mode : opinion.modes)
    result.hypotheses.push_back({ComposeFromCrops(views[0], views[1], mode.rotation), mode.probability, "prior"});
  result.query_from_reference = result.hypotheses.front().query_from_reference;
  result.confidence = prior.Confidence(opinion.modes.front());
  Keep(std::move(views), result);
  return result;
}

TwoViewPose EstimatePoseByMatching(const Matcher& matcher, const ObjectPhotograph& reference,
                                   const ObjectPhotograph& query, const TwoViewPoseOptions& options) {
  options.Check();
  TwoViewPose result;
  Stopwatch stopwatch;
  CroppedPair views = Crop(reference, query, {.size = options.matching_size});
  result.timings_s["crop"] = stopwatch.Lap();
  const MatchedViews matched = Match(matcher, views, options.matching, result);
  if (matched.geometry.status == TwoViewStatus::kTooFewMatches)
    throw Error("matching", "found too few consistent matches (" + std::to_string(matched.correspondences.size()) + " in all)",
                "use --method auto, which also knows what the object's other sides may look like");
  const WeighedPose weighed = MostProbable(views, matched);
  File(weighed, result);
  WarnOfDegeneracy(weighed.geometry.status, result);
  result.query_from_reference = ComposeFromMatches(views, weighed.geometry);
  result.confidence = weighed.probability;
  result.hypotheses = {{result.query_from_reference, result.confidence, "matching"}};
  Keep(std::move(views), result);
  return result;
}

TwoViewPose EstimatePoseByBoth(const ObjectPrior& prior, const Matcher& matcher, const ObjectPhotograph& reference,
                               const ObjectPhotograph& query, const TwoViewPoseOptions& options) {
  options.Check();
  TwoViewPose result;
  Stopwatch stopwatch;
  CroppedPair small = Crop(reference, query, prior.ViewOptions());
  const CroppedPair large = Crop(reference, query, {.size = options.matching_size});
  result.timings_s["crop"] = stopwatch.Lap();
  const PriorOpinion opinion = AskPrior(prior, small, options, result);
  const double prior_confidence = prior.Confidence(opinion.modes.front());

  ViewMatchingOptions matching = options.matching;
  const GridPosterior posterior = prior.OnGrid(opinion.codes[0], opinion.codes[1], opinion.weighed);
  matching.quarter_turns = TurnsSuggestedBy(posterior);
  const MatchedViews matched = Match(matcher, large, matching, result);
  result.evidence["prior_confidence"] = prior_confidence;
  const std::vector<JointHypothesis> joint = WeighTogether(matcher, large, matched, opinion, posterior, result);
  const JointHypothesis& best = joint.front();
  Take(joint, large, JointConfidence({best.share, best.support, prior_confidence}), options.hypotheses, result);
  result.query_from_reference = result.hypotheses.front().query_from_reference;
  Keep(std::move(small), result);
  return result;
}

double MatchingProbability(const MatchingEvidence& evidence) {
  const double inliers = std::log1p(evidence.inliers);
  const double share = evidence.inliers / std::max(1.0, static_cast<double>(evidence.matches));
  const double deviation = std::log(std::clamp(evidence.rotation_deviation_deg, 0.01, 180.0));
  const double disagreement = std::log1p(evidence.translation_disagreement_deg);
  const MatchingWeights& w = kMatching;
  return Logistic(w.constant + w.inliers * inliers + w.share * share + w.deviation * deviation + w.disagreement * disagreement);
}

double JointConfidence(const JointEvidence& evidence) {
  const double share = std::clamp(evidence.share, kLeastShare, 1 - kLeastShare);
  const double by_itself = std::exp(-std::max(evidence.support, 0.0) / kTellingSupport);
  return Logistic(kJoint.constant + kJoint.share * LogOdds(share) +
                  by_itself * (kJoint.prior * LogOdds(evidence.prior_confidence) + kJoint.by_itself));
}

}  // namespace antipode
