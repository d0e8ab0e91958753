#pragma once

#include <vector>

#include <Eigen/Core>

namespace antipode {

/// `count` nearly uniform rotations: the super-Fibonacci spirals of Alexa, CVPR 2022. The mean distance
/// between neighbours is about (8 pi^2 / count)^(1/3) radians: 15 degrees for 4096, 9 for 20,000.
std::vector<Eigen::Matrix3d> SuperFibonacciRotations(int count);

/// Nearly uniform rotations R_i G_j: the products of the 24 rotations G_j of the cube with a cell of rotations R_i, those that are
/// nearer to the identity than to any other G_j. The cell is a cubic lattice in homochoric coordinates
///   h = (3/4 (angle - sin angle))^(1/3) axis,
/// which keep volumes, so that every rotation stands for the same share of SO(3) (Rosca, Morawiec, De Graef, "A new method of
/// constructing a grid in the space of 3D rotations", Modelling Simul. Mater. Sci. Eng. 22, 2014).
///
/// The grid is closed under inversion and under the G_j from both sides: R in it, then R^T, R G_j and G_j R, too.
class CubeSymmetricGrid {
 public:
  /// @param count about how many rotations there shall be
  /// @throws InvalidOption if that would leave the cell empty
  explicit CubeSymmetricGrid(int count);

  const std::vector<Eigen::Matrix3d>& cell() const { return cell_; }
  /// The first is the identity.
  const std::vector<Eigen::Matrix3d>& turns() const { return turns_; }
  /// R_i G_j at IndexOf(i, j).
  const std::vector<Eigen::Matrix3d>& rotations() const { return rotations_; }
  /// Unit quaternions of all rotations, w x y z.
  const Eigen::Matrix4Xd& quaternions() const { return quaternions_; }
  int IndexOf(int i, int j) const { return i * static_cast<int>(turns_.size()) + j; }

  /// Index of G_m G_j among the turns.
  int ProductOf(int m, int j) const { return products_[IndexOf(m, j)]; }

  /// R_k G_m of the grid.
  struct Element {
    int cell, turn;
  };
  /// For every R_i the other rotations R_k G_m within an angle of it. The neighbours of R_i G_j are R_k G_m G_j.
  std::vector<std::vector<Element>> FindNeighbours(double angle_deg) const;

 private:
  std::vector<Eigen::Matrix3d> cell_, turns_, rotations_;
  Eigen::Matrix4Xd quaternions_;
  std::vector<int> products_;
};

}  // namespace antipode
