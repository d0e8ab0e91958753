#include "antipode/geometry/so3_grid.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "antipode/util/error.h"

namespace antipode {

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

}  // namespace antipode
