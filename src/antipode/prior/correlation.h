#pragma once

#include <span>

#include <Eigen/Core>
#include <torch/torch.h>

#include "antipode/geometry/wigner.h"

namespace antipode {

/// Correlation of two codes over SO(3). With C_l = sum_c F_query[c, l] F_reference[c, l]^T the score of a
/// rotation is s(R) = sum_l <C_l, D_l(R)>, a dot product of the stacked C_l with `WignerMatrices(R)`.
///
/// @param query, reference [P, C, (L + 1)^2]
/// @return [P, WignerSize(L)], the stacked C_l
torch::Tensor CorrelateCodes(const torch::Tensor& query, const torch::Tensor& reference, int max_degree);

/// [N, 3, 3], float32
torch::Tensor ToTensor(std::span<const Eigen::Matrix3d> rotations);

/// [rows, columns], float32
torch::Tensor ToTensor(const RowMajorMatrixXf& rows);

/// L of codes [.., (L + 1)^2].
int MaxDegreeOf(const torch::Tensor& codes);

/// The code of the turned object: D(R) F.
/// @param code [C, (L + 1)^2]
torch::Tensor TurnCode(const torch::Tensor& code, const Eigen::Matrix3d& rotation);

/// The codes of objects turned in several ways: D(R_k) F.
/// @param codes [B, C, (L + 1)^2]
/// @param rotations [B, K, 3, 3]
/// @return [B, K, C, (L + 1)^2]
torch::Tensor TurnCodes(const torch::Tensor& codes, const torch::Tensor& rotations);

/// Negative log density of the true rotations under p(R) = exp(s(R)) / mean over SO(3) of exp(s), against
/// the uniform density; the mean is taken over a grid. 0 for a code that knows nothing.
///
/// @param correlations [P, WignerSize]
/// @param true_wigner  [P, WignerSize], Wigner matrices of query_from_reference
/// @param grid_wigner  [G, WignerSize]
/// @return [P]
torch::Tensor NegativeLogDensity(const torch::Tensor& correlations, const torch::Tensor& true_wigner,
                                 const torch::Tensor& grid_wigner);

}  // namespace antipode
