#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace antipode {

/// Real Wigner matrices D_l(R), defined by Y_l(R x) = D_l(R) Y_l(x) for the real spherical harmonics of
/// spherical_harmonics.h. They are orthogonal and multiply like the rotations: D(A B) = D(A) D(B).
///
/// Matrices of degree 0..max_degree are stacked in one vector: block l starts at `WignerOffset(l)` and
/// holds (2l+1) x (2l+1) values, row-major. Computed by the recursion of Ivanic and Ruedenberg,
/// J. Phys. Chem. 100 (1996) 6342, with the erratum of 102 (1998) 9099.

/// Where the block of `degree` starts: sum over l < degree of (2l+1)^2.
constexpr int WignerOffset(int degree) { return degree * (4 * degree * degree - 1) / 3; }

/// Length of the stacked vector: 455 for max_degree 6, 969 for 8.
constexpr int WignerSize(int max_degree) { return WignerOffset(max_degree + 1); }

Eigen::VectorXd WignerMatrices(const Eigen::Matrix3d& rotation, int max_degree);

using RowMajorMatrixXf = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// One row of length `WignerSize(max_degree)` a rotation, in single precision (error below 1e-5 up to degree 10).
RowMajorMatrixXf WignerMatrices(std::span<const Eigen::Matrix3d> rotations, int max_degree);

/// Block of `degree` in a stacked vector.
inline Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>
WignerBlock(const Eigen::VectorXd& stacked, int degree) {
  return {stacked.data() + WignerOffset(degree), 2 * degree + 1, 2 * degree + 1};
}

/// Generators G_x, G_y, G_z of one degree: D_l(exp([w]_x)) = I + w_x G_x + w_y G_y + w_z G_z + O(|w|^2).
std::array<Eigen::MatrixXd, 3> WignerGenerators(int degree);

}  // namespace antipode
