#pragma once

#include <Eigen/Core>

namespace antipode {

/// Number of real spherical harmonics of degree 0..max_degree: (max_degree + 1)^2.
constexpr int SphericalHarmonicCount(int max_degree) { return (max_degree + 1) * (max_degree + 1); }

/// Real orthonormal spherical harmonics Y_{l,m}(direction), l = 0..max_degree, m = -l..l, at index
/// l^2 + l + m. Without the Condon-Shortley phase, so that Y_{1,-1..1} = sqrt(3 / 4 pi) (y, z, x).
/// @param direction a unit vector
Eigen::VectorXd SphericalHarmonics(const Eigen::Vector3d& direction, int max_degree);

}  // namespace antipode
