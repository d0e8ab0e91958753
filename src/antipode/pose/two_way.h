#pragma once

#include "antipode/pose/two_view_pose.h"

namespace antipode {

/// The estimate of the same photographs in the other order: every pose inverted.
TwoViewPose Swapped(TwoViewPose pose);

/// Two estimates of one pose, such as one and the other direction's `Swapped`, as one. Every hypothesis is worth
///   w(R) = (e + sum_a p_a k(R, R_a)) (e + sum_b p_b k(R, R_b)),  k(A, B) = exp(-angle(A, B)^2 / 2 s^2),
/// with s = 15 degrees and e = 0.05, so that a hypothesis that only one estimate knows still counts. Those within 30
/// degrees of a better one are left out, the others share the larger mass of both by their worth. The confidence is that of
/// the estimates whose best hypothesis is within 30 degrees of the result's, times its share. Crops and evidence are
/// of the first, with "two_way_disagreement_deg" between the best rotations; more than 30 degrees is a warning.
TwoViewPose Reconcile(TwoViewPose first, const TwoViewPose& second);

}  // namespace antipode
