#include "antipode/pose/two_view_pose.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"
#include "antipode/util/stopwatch.h"

namespace antipode {
namespace {

constexpr double kTrustedDirectionDeg = 10;  // of the translation, by the covariance
constexpr double kSameModeDeg = 30;
constexpr double kTurnWorthTrying = 0.1;  // posterior mass; at least one of four quarter turns has more

/// Printed by scripts/fit_matching_probability.py.
struct MatchingWeights {
  double constant, inliers, share, deviation, disagreement;
};
constexpr MatchingWeights kWithPrior{-1.922, 1.321, -0.226, -0.207, -1.217};
constexpr double kPriorMassWeight = 0.451;
constexpr MatchingWeights kWithoutPrior{-5.465, 1.655, 0.107, -0.485, -0.817};

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
  for (const RotationMode& mode : opinion.modes)
    result.hypotheses.push_back({ComposeFromCrops(views[0], views[1], mode.rotation), mode.probability, "prior"});
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

WeighedPose Weigh(const CroppedPair& views, const MatchedViews& matched, const TwoViewGeometry& geometry,
                  const GridPosterior* prior) {
  WeighedPose weighed{geometry, {}, 0};
  weighed.evidence = {static_cast<int>(matched.correspondences.size()), geometry.inliers,
                      std::min(geometry.RotationDeviationDeg(), 180.0),
                      TranslationDisagreementDeg(views, geometry.query_from_reference), {}};
  if (prior != nullptr) weighed.evidence.prior_mass = prior->MassAround(geometry.query_from_reference.rotation);
  weighed.probability = MatchingProbability(weighed.evidence);
  return weighed;
}

/// Of all explanations of the matches the most probable.
WeighedPose MostProbable(const CroppedPair& views, const MatchedViews& matched, const GridPosterior* prior) {
  WeighedPose best = Weigh(views, matched, matched.geometry, prior);
  for (const TwoViewGeometry& alternative : matched.alternatives) {
    WeighedPose other = Weigh(views, matched, alternative, prior);
    if (other.probability > best.probability) best = std::move(other);
  }
  return best;
}

void File(const WeighedPose& weighed, TwoViewPose& result) {
  const MatchingEvidence& evidence = weighed.evidence;
  result.evidence["inliers"] = evidence.inliers;
  result.evidence["rotation_deviation_deg"] = evidence.rotation_deviation_deg;
  result.evidence["translation_disagreement_deg"] = evidence.translation_disagreement_deg;
  if (evidence.prior_mass) result.evidence["prior_mass"] = *evidence.prior_mass;
  result.evidence["matching_probability"] = weighed.probability;
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

/// The likeliest so many, and in any case that of matching: whoever asks for matching wants to see what it found.
void KeepBest(int most, std::vector<PoseHypothesis>& hypotheses) {
  while (hypotheses.size() > static_cast<std::size_t>(most)) {
    const bool last_is_matching = hypotheses.size() > 1 && hypotheses.back().source == "matching";
    hypotheses.erase(hypotheses.end() - (last_is_matching ? 2 : 1));
  }
}

/// Puts the pose of matching beside the prior's hypotheses, which keep their worth only as far as matching is
/// wrong; those near it become part of it.
void AddMatching(const Rigid3& pose, double probability, double prior_confidence, TwoViewPose& result) {
  const auto is_near = [&](const PoseHypothesis& hypothesis) {
    return AngleBetweenDeg(hypothesis.query_from_reference.rotation, pose.rotation) < kSameModeDeg;
  };
  const bool agree = is_near(result.hypotheses.front());
  PoseHypothesis matching{pose, probability, "matching"};
  for (PoseHypothesis& hypothesis : result.hypotheses) {
    hypothesis.probability *= 1 - probability;
    if (is_near(hypothesis)) matching.probability += hypothesis.probability;
  }
  std::erase_if(result.hypotheses, is_near);
  result.hypotheses.push_back(matching);
  std::stable_sort(result.hypotheses.begin(), result.hypotheses.end(),
                   [](const PoseHypothesis& a, const PoseHypothesis& b) { return a.probability > b.probability; });
  const bool matching_is_best = result.hypotheses.front().source == "matching";
  const double otherwise = (1 - probability) * prior_confidence;
  result.confidence = matching_is_best ? probability + (agree ? otherwise : 0) : otherwise;
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
  const WeighedPose weighed = MostProbable(views, matched, nullptr);
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
  result.confidence = prior_confidence;

  ViewMatchingOptions matching = options.matching;
  const GridPosterior posterior = prior.OnGrid(opinion.codes[0], opinion.codes[1], opinion.weighed);
  matching.quarter_turns = TurnsSuggestedBy(posterior);
  for (const RotationMode& mode : opinion.modes) matching.starts.push_back(mode.rotation);
  const MatchedViews matched = Match(matcher, large, matching, result);
  if (matched.geometry.status != TwoViewStatus::kTooFewMatches) {
    const WeighedPose weighed = MostProbable(large, matched, &posterior);
    File(weighed, result);
    AddMatching(ComposeFromMatches(large, weighed.geometry), weighed.probability, prior_confidence, result);
    KeepBest(options.hypotheses, result.hypotheses);
    if (result.hypotheses.front().source == "matching") WarnOfDegeneracy(weighed.geometry.status, result);
  }
  result.query_from_reference = result.hypotheses.front().query_from_reference;
  Keep(std::move(small), result);
  return result;
}

double MatchingProbability(const MatchingEvidence& evidence) {
  const double inliers = std::log1p(evidence.inliers);
  const double share = evidence.inliers / std::max(1.0, static_cast<double>(evidence.matches));
  const double deviation = std::log(std::clamp(evidence.rotation_deviation_deg, 0.01, 180.0));
  const double disagreement = std::log1p(evidence.translation_disagreement_deg);
  const auto weighted = [&](const MatchingWeights& w) {
    return w.constant + w.inliers * inliers + w.share * share + w.deviation * deviation + w.disagreement * disagreement;
  };
  const double log_odds = evidence.prior_mass
                              ? weighted(kWithPrior) + kPriorMassWeight * LogOdds(*evidence.prior_mass)
                              : weighted(kWithoutPrior);
  return 1 / (1 + std::exp(-log_odds));
}

}  // namespace antipode
