#include "antipode/geometry/so3_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kRounding = 1e-12;
constexpr int kNewtonSteps = 6;  // for angles below 65 degrees the second has nearly all digits

/// The signed permutation matrices of determinant 1, the identity first.
std::vector<Eigen::Matrix3d> CubeRotations() {
  std::vector<Eigen::Matrix3d> rotations;
  std::array<int, 3> axes = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
      for (int row = 0; row < 3; ++row) matrix(row, axes[row]) = (signs >> row) & 1 ? -1 : 1;
      if (matrix.determinant() > 0) rotations.push_back(matrix);
    }
  } while (std::ranges::next_permutation(axes).found);
  return rotations;
}

/// Solves angle - sin angle = 4/3 h^3.
double AngleFromHomochoric(double h) {
  double angle = 2 * h;
  for (int step = 0; step < kNewtonSteps; ++step)
    angle -= (angle - std::sin(angle) - 4.0 / 3.0 * h * h * h) / (1 - std::cos(angle));
  return angle;
}

Eigen::Matrix3d RotationFromHomochoric(const Eigen::Vector3d& h) {
  return RotationFromVector(h.normalized() * AngleFromHomochoric(h.norm()));
}

bool IsNearestToIdentity(const Eigen::Matrix3d& rotation, const std::vector<Eigen::Matrix3d>& others) {
  return std::ranges::none_of(others, [&](const Eigen::Matrix3d& other) { return rotation.cwiseProduct(other).sum() > rotation.trace() + kRounding; });
}

/// The points of a cubic lattice inside the cell of the identity; none is at the origin, so that all of a layer have the same distance to it.
std::vector<Eigen::Matrix3d> CellOf(const std::vector<Eigen::Matrix3d>& turns, double spacing) {
  constexpr double kFarthest = 0.6;  // homochoric; the corners of the cell are 62.8 degrees away, at 0.53
  const int most = static_cast<int>(kFarthest / spacing) + 1;
  std::vector<Eigen::Matrix3d> cell;
  for (int x = -most; x < most; ++x) {
    for (int y = -most; y < most; ++y) {
      for (int z = -most; z < most; ++z) {
        const Eigen::Vector3d h = spacing * (Eigen::Vector3d(x, y, z).array() + 0.5).matrix();
        if (h.norm() > kFarthest) continue;
        const Eigen::Matrix3d rotation = RotationFromHomochoric(h);
        if (IsNearestToIdentity(rotation, turns)) cell.push_back(rotation);
      }
    }
  }
  return cell;
}

}  // namespace

std::vector<Eigen::Matrix3d> SuperFibonacciRotations(int count) {
  if (count < 1) throw InvalidOption("rotation grid", "needs at least one rotation");
  // phi = sqrt(2) and psi, the positive root of psi^4 = psi + 4, are the constants of the paper.
  constexpr double kPhi = std::numbers::sqrt2;
  constexpr double kPsi = 1.533751168755204288118041;
  std::vector<Eigen::Matrix3d> rotations;
  rotations.reserve(count);
  for (int i = 0; i < count; ++i) {
    const double s = i + 0.5;
    const double inner = std::sqrt(s / count), outer = std::sqrt(1 - s / count);
    const double alpha = 2 * std::numbers::pi * s / kPhi, beta = 2 * std::numbers::pi * s / kPsi;
    const Eigen::Quaterniond quaternion(outer * std::cos(beta), inner * std::sin(alpha),
                                        inner * std::cos(alpha), outer * std::sin(beta));
    rotations.push_back(quaternion.toRotationMatrix());
  }
  return rotations;
}

CubeSymmetricGrid::CubeSymmetricGrid(int count) : turns_(CubeRotations()) {
  // SO(3) fills pi^2 of the homochoric space.
  if (count > 0) cell_ = CellOf(turns_, std::cbrt(std::numbers::pi * std::numbers::pi / count));
  if (cell_.empty()) throw InvalidOption("rotation grid", "needs more rotations", "use at least 200");
  for (const Eigen::Matrix3d& rotation : cell_)
    for (const Eigen::Matrix3d& turn : turns_) rotations_.push_back(rotation * turn);
  quaternions_.resize(4, static_cast<Eigen::Index>(rotations_.size()));
  for (Eigen::Index g = 0; g < quaternions_.cols(); ++g) quaternions_.col(g) = QuaternionWxyz(rotations_[g]);
  for (const Eigen::Matrix3d& left : turns_)
    for (const Eigen::Matrix3d& right : turns_)
      products_.push_back(static_cast<int>(std::ranges::find(turns_, Eigen::Matrix3d(left * right)) - turns_.begin()));
}

std::vector<std::vector<CubeSymmetricGrid::Element>> CubeSymmetricGrid::FindNeighbours(double angle_deg) const {
  const auto turns = static_cast<int>(turns_.size());
  const double least_cosine = std::cos(RadiansFromDegrees(angle_deg / 2));  // of quaternions
  std::vector<std::vector<Element>> neighbours(cell_.size());
  for (int i = 0; i < static_cast<int>(cell_.size()); ++i) {
    const int itself = IndexOf(i, 0);
    const Eigen::VectorXd cosines = (quaternions_.transpose() * quaternions_.col(itself)).cwiseAbs();
    for (int g = 0; g < cosines.size(); ++g)
      if (cosines[g] >= least_cosine && g != itself) neighbours[i].push_back({g / turns, g % turns});
  }
  return neighbours;
}

}  // namespace antipode
