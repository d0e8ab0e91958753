#pragma once

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
/// matches, and the modes also stay as they are.
/// @return best first, never empty; the shares sum to 1
std::vector<JointHypothesis> WeighTogether(const CentredGeometry& matches, const GridPosterior& prior,
                                           std::span<const RotationMode> modes,
                                           std::span<const Eigen::Matrix3d> further_starts,
                                           const JointPosteriorOptions& options = {});

}  // namespace antipode
