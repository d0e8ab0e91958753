#pragma once

#include <torch/torch.h>

#include "antipode/gen6d/refiner.h"

namespace antipode {

/// Losses of the selector and the refiner (Liu et al., "Gen6D", ECCV 2022).

/// Binary cross-entropy of the logits with the scores scaled to 0..1 over the references, averaged over them.
/// @param logits [Q, N]
/// @param scores [Q, N], cosine between the viewing directions of query and reference
/// @return [Q]
torch::Tensor ViewSelectionLoss(const torch::Tensor& logits, const torch::Tensor& scores);

/// (angle at the nearest reference - true angle 2 / pi)^2.
/// @param angles [Q, N], in units of 90 degrees
/// @param true_angles [Q], radians
/// @param nearest [Q], int64
/// @return [Q]
torch::Tensor InPlaneAngleLoss(const torch::Tensor& angles, const torch::Tensor& true_angles, const torch::Tensor& nearest);

/// Mean over points x of |s R (x - c) + c + (offset, 0) - target(x)|^2, c the object's centre.
/// @param points [B, P, 3], input camera frame
/// @param centres [B, 3], input camera frame
/// @param target [B, 3, 4], similarity
/// @return [B]
torch::Tensor PoseChangeLoss(const RefinerOutput& output, const torch::Tensor& points, const torch::Tensor& centres,
                             const torch::Tensor& target);

/// @param quaternions [B, 4], unit, w x y z
torch::Tensor RotationMatrices(const torch::Tensor& quaternions);  // [B, 3, 3]

}  // namespace antipode
