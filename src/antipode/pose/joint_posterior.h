#pragma once

#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "antipode/geometry/rigid3.h"
#include "antipode/matching/centred_geometry.h"
#include "antipode/prior/posterior.h"

namespace antipode {

/// One pose with what prior and matches say of it.
struct JointHypothesis {
  Rigid3 query_crop_from_reference_crop;  ///< in object radii
  double prior_mass = 0;   ///< of the prior's posterior within 15 degrees
  double support = 0;      ///< of the matches, see CentredGeometry
  std::size_t matches = 0; ///< n, so many could have supported it
  double share = 0;        ///< of the worth of all hypotheses together
  bool is_refined = false; ///< by the matches; otherwise it is a mode of the prior
};

struct JointPosteriorOptions {
  int starts = 16;                  ///< rotations of the prior's grid that are refined by the matches
  double start_separation_deg = 12;
  double separation_deg = 30;       ///< hypotheses nearer to a better one are left out
  void Check() const;
};

/// Prior and matches together. A pose is worth
///   w = m exp(a S^2 / n),  a = 0.08,
/// with m the prior's mass around its rotation and S the support of the n matches: it counts little for its number, since
/// matches err together, and less where many disagree, since some pose always finds some support. Rotations of the prior's
/// grid with much mass and support are starts, beside the prior's modes and `further_starts`; all are refined by the
/// matches, and the modes also stay as they are. Without matches there are only the modes.
/// @return best first, never empty; the shares sum to 1
std::vector<JointHypothesis> WeighTogether(const CentredGeometry& matches, const GridPosterior& prior,
                                           std::span<const RotationMode> modes,
                                           std::span<const Eigen::Matrix3d> further_starts,
                                           const JointPosteriorOptions& options = {});

/// Finds matches given how the query's crop is turned to the reference's, see MatchHalfway.
using MatchGivenRotation = std::function<Correspondences(const Eigen::Matrix3d& query_crop_from_reference_crop)>;

struct OwnMatchesOptions {
  int most_hypotheses = 5;       ///< that get matches of their own, best first
  double least_share = 0.01;     ///< of a hypothesis that gets some
  std::size_t least_matches = 8; ///< fewer are chance, and count as none
  double separation_deg = 30;    ///< hypotheses nearer to a better one are left out
  void Check() const;
};

/// Weighs hypotheses of `WeighTogether` anew, each also by matches that were found under it. It is then worth
///   w = m^a exp(b sqrt(d) - c max(0, 1 - angle / 100 degrees)^2),  a = 0.75, b = 1.35, c = 3.7,
/// where d is the greater of S / sqrt(n) and S' / sqrt(n'), with S of the n matches of all and S' of the n' of its own: supports in
/// standard deviations of a count, since now the matches differ from hypothesis to hypothesis, and a wrong one has few. The angle is
/// that between the optical axes: the nearer both cameras are said to be, the more they have in common, and the more it speaks against
/// that if little of it is found. The pose is that of the greater of both.
///
/// The weights are those under which the true hypotheses of validation objects are likeliest.
/// @return best first; the shares sum to 1
std::vector<JointHypothesis> WeighByOwnMatches(std::vector<JointHypothesis> hypotheses, const GridPosterior& prior,
                                               const CentredCameras& cameras, const MatchGivenRotation& match,
                                               const OwnMatchesOptions& options = {});

}  // namespace antipode
