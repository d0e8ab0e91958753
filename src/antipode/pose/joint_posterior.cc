#include "antipode/pose/joint_posterior.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "antipode/geometry/rotation.h"
#include "antipode/pose/halfway_matching.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kSupportWeight = 0.08;  // a of WeighTogether
// Of LogWorthByOwnMatches.
constexpr double kMassWeight = 0.75, kOwnSupportWeight = 1.35, kSilenceWeight = 3.7;
constexpr double kNothingInCommonDeg = 100;
// The search leaves the centre where the crops have it and so finds less support than there is.
constexpr double kSearchWeight = 0.2;
constexpr double kLeastMass = 1e-6;    // of a hypothesis, so that matches can speak for any
constexpr double kLeastWeight = 1e-7;  // of a rotation of the grid
constexpr std::size_t kMostSorted = 2000;

/// Rotations of the grid, likeliest first, none near another.
std::vector<Eigen::Matrix3d> StartsOnGrid(const CentredGeometry& matches, const GridPosterior& prior,
                                          const JointPosteriorOptions& options) {
  const Eigen::VectorXd worth = kSearchWeight * matches.SearchSupport(prior.rotations).cast<double>().array() +
                                (prior.weights.array() + kLeastWeight).log();
  std::vector<std::size_t> order(prior.rotations.size());
  std::iota(order.begin(), order.end(), 0);
  const std::size_t sorted = std::min(kMostSorted, order.size());
  std::ranges::partial_sort(order, order.begin() + static_cast<std::ptrdiff_t>(sorted), [&](std::size_t a, std::size_t b) {
    return worth[static_cast<Eigen::Index>(a)] > worth[static_cast<Eigen::Index>(b)];
  });
  std::vector<Eigen::Matrix3d> starts;
  for (std::size_t i = 0; i < sorted && starts.size() < static_cast<std::size_t>(options.starts); ++i) {
    const Eigen::Matrix3d& candidate = prior.rotations[order[i]];
    const bool is_near = std::ranges::any_of(starts, [&](const Eigen::Matrix3d& start) {
      return AngleBetweenDeg(start, candidate) < options.start_separation_deg;
    });
    if (!is_near) starts.push_back(candidate);
  }
  return starts;
}

/// S / sqrt(n), or 0 without matches.
double Deviations(const JointHypothesis& hypothesis) {
  return hypothesis.matches > 0 ? std::max(hypothesis.support, 0.0) / std::sqrt(static_cast<double>(hypothesis.matches)) : 0;
}

double LogWorth(const JointHypothesis& hypothesis) {
  const double deviations = Deviations(hypothesis);
  return kSupportWeight * deviations * deviations + std::log(hypothesis.prior_mass + kLeastMass);
}

double LogWorthByOwnMatches(const JointHypothesis& hypothesis) {
  const double angle = AngleBetweenAxesDeg(hypothesis.query_crop_from_reference_crop.rotation);
  const double in_common = std::max(0.0, 1 - angle / kNothingInCommonDeg);
  return kMassWeight * std::log(hypothesis.prior_mass + kLeastMass) + kOwnSupportWeight * std::sqrt(Deviations(hypothesis)) -
         kSilenceWeight * in_common * in_common;
}

/// Sorted, without those near a better one, with their shares.
std::vector<JointHypothesis> Rank(std::vector<JointHypothesis> hypotheses, double (*log_worth)(const JointHypothesis&),
                                  double separation_deg) {
  std::ranges::stable_sort(hypotheses, std::ranges::greater{}, log_worth);
  std::vector<JointHypothesis> kept;
  double sum = 0;
  for (JointHypothesis& hypothesis : hypotheses) {
    const bool is_near = std::ranges::any_of(kept, [&](const JointHypothesis& better) {
      return AngleBetweenDeg(better.query_crop_from_reference_crop.rotation,
                             hypothesis.query_crop_from_reference_crop.rotation) < separation_deg;
    });
    if (is_near) continue;
    sum += hypothesis.share = std::exp(log_worth(hypothesis) - log_worth(hypotheses.front()));
    kept.push_back(hypothesis);
  }
  for (JointHypothesis& hypothesis : kept) hypothesis.share /= sum;
  return kept;
}

}  // namespace

void JointPosteriorOptions::Check() const {
  if (starts < 1) throw InvalidOption("starts", "must be positive");
  if (!(start_separation_deg > 0)) throw InvalidOption("start_separation_deg", "must be positive");
  if (!(separation_deg > 0)) throw InvalidOption("separation_deg", "must be positive");
}

std::vector<JointHypothesis> WeighTogether(const CentredGeometry& matches, const GridPosterior& prior,
                                           std::span<const RotationMode> modes,
                                           std::span<const Eigen::Matrix3d> further_starts,
                                           const JointPosteriorOptions& options) {
  options.Check();
  std::vector<JointHypothesis> hypotheses;
  const auto add = [&](const CentredGeometry::SupportedPose& pose, bool is_refined) {
    const double mass = prior.MassAround(pose.query_from_reference.rotation);
    hypotheses.push_back({pose.query_from_reference, mass, pose.support, matches.Matches(), 0, is_refined});
  };
  for (const RotationMode& mode : modes) add(matches.Centred(mode.rotation), false);
  if (matches.Matches() > 0) {
    std::vector<Eigen::Matrix3d> starts = StartsOnGrid(matches, prior, options);
    for (const RotationMode& mode : modes) starts.push_back(mode.rotation);
    starts.insert(starts.end(), further_starts.begin(), further_starts.end());
    for (const Eigen::Matrix3d& start : starts) add(matches.Refine(start), true);
  }
  return Rank(std::move(hypotheses), LogWorth, options.separation_deg);
}

void OwnMatchesOptions::Check() const {
  if (most_hypotheses < 0) throw InvalidOption("most_hypotheses", "must not be negative");
  if (!(least_share >= 0 && least_share <= 1)) throw InvalidOption("least_share", "must be 0 to 1");
  if (!(separation_deg > 0)) throw InvalidOption("separation_deg", "must be positive");
}

std::vector<JointHypothesis> WeighByOwnMatches(std::vector<JointHypothesis> hypotheses, const GridPosterior& prior,
                                               const CentredCameras& cameras, const MatchGivenRotation& match,
                                               const OwnMatchesOptions& options) {
  options.Check();
  for (std::size_t i = 0; i < hypotheses.size() && i < static_cast<std::size_t>(options.most_hypotheses); ++i) {
    if (hypotheses[i].share < options.least_share) break;
    const Eigen::Matrix3d& rotation = hypotheses[i].query_crop_from_reference_crop.rotation;
    const CentredGeometry matches(match(rotation), cameras);
    if (matches.Matches() < options.least_matches) continue;
    const CentredGeometry::SupportedPose pose = matches.Refine(rotation);
    const double mass = prior.MassAround(pose.query_from_reference.rotation);
    const JointHypothesis by_own{pose.query_from_reference, mass, pose.support, matches.Matches(), 0, true};
    if (Deviations(by_own) > Deviations(hypotheses[i])) hypotheses[i] = by_own;
  }
  return Rank(std::move(hypotheses), LogWorthByOwnMatches, options.separation_deg);
}

}  // namespace antipode
