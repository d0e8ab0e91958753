#include "antipode/pose/two_way.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "antipode/geometry/rotation.h"
#include "antipode/util/formatted.h"

namespace antipode {
namespace {

constexpr double kKernelDeg = 15, kFloor = 0.05, kSameModeDeg = 30;
constexpr double kWorthSteps = 1e6;  // of the logarithm; what differs by less is equal

using Hypotheses = std::vector<PoseHypothesis>;

double AngleDeg(const Rigid3& a, const Rigid3& b) { return AngleBetweenDeg(a.rotation, b.rotation); }

double Mass(const Hypotheses& hypotheses) {
  double mass = 0;
  for (const PoseHypothesis& hypothesis : hypotheses) mass += hypothesis.probability;
  return mass;
}

double Density(const Hypotheses& hypotheses, const Rigid3& pose) {
  double density = kFloor;
  for (const PoseHypothesis& hypothesis : hypotheses) {
    const double deviations = AngleDeg(hypothesis.query_from_reference, pose) / kKernelDeg;
    density += hypothesis.probability * std::exp(-0.5 * deviations * deviations);
  }
  return density;
}

/// Best first, with the worth in place of the probability. Of equal ones, such as both directions' versions of one mode, that
/// with the smaller rotation comes first, which it has in either order of the photographs.
Hypotheses ByWorth(const Hypotheses& first, const Hypotheses& second) {
  Hypotheses candidates = first;
  candidates.insert(candidates.end(), second.begin(), second.end());
  for (PoseHypothesis& candidate : candidates)
    candidate.probability = Density(first, candidate.query_from_reference) * Density(second, candidate.query_from_reference);
  const auto rank = [](const PoseHypothesis& candidate) {
    return std::pair(-std::llround(kWorthSteps * std::log(candidate.probability)), RotationAngleDeg(candidate.query_from_reference.rotation));
  };
  std::ranges::stable_sort(candidates, {}, rank);
  Hypotheses distinct;
  for (const PoseHypothesis& candidate : candidates) {
    const bool is_known = std::ranges::any_of(distinct, [&](const PoseHypothesis& better) {
      return AngleDeg(better.query_from_reference, candidate.query_from_reference) < kSameModeDeg;
    });
    if (!is_known) distinct.push_back(candidate);
  }
  return distinct;
}

}  // namespace

TwoViewPose Swapped(TwoViewPose pose) {
  pose.query_from_reference = pose.query_from_reference.Inverse();
  for (PoseHypothesis& hypothesis : pose.hypotheses) hypothesis.query_from_reference = hypothesis.query_from_reference.Inverse();
  std::swap(pose.reference, pose.query);
  return pose;
}

TwoViewPose Reconcile(TwoViewPose first, const TwoViewPose& second) {
  const double disagreement = AngleDeg(first.query_from_reference, second.query_from_reference);
  const double mass = std::max(Mass(first.hypotheses), Mass(second.hypotheses));
  const std::size_t listed = std::max(first.hypotheses.size(), second.hypotheses.size());

  Hypotheses hypotheses = ByWorth(first.hypotheses, second.hypotheses);
  const double worth = Mass(hypotheses);
  for (PoseHypothesis& hypothesis : hypotheses) hypothesis.probability *= mass / worth;
  const Rigid3& best = hypotheses.front().query_from_reference;
  double confidence = 0;
  if (AngleDeg(best, first.query_from_reference) < kSameModeDeg) confidence = first.confidence;
  if (AngleDeg(best, second.query_from_reference) < kSameModeDeg) confidence = std::max(confidence, second.confidence);

  first.confidence = mass > 0 ? confidence * hypotheses.front().probability / mass : 0;
  first.query_from_reference = best;
  first.hypotheses = {hypotheses.begin(), hypotheses.begin() + static_cast<std::ptrdiff_t>(std::min(listed, hypotheses.size()))};
  for (const auto& [stage, seconds] : second.timings_s) first.timings_s[stage] += seconds;
  for (const std::string& warning : second.warnings) first.warnings.push_back("swapped: " + warning);
  first.evidence["two_way_disagreement_deg"] = disagreement;
  if (disagreement > kSameModeDeg)
    first.warnings.push_back(Formatted("the two directions disagree by %.0f degrees", disagreement));
  return first;
}

}  // namespace antipode
