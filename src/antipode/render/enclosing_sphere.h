#pragma once

#include <span>

#include <Eigen/Core>

namespace antipode {

struct Sphere {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0;
};

/// The smallest sphere that holds every point (to a relative 1e-9); radius 0 at the origin if there
/// is no point.
Sphere SmallestEnclosingSphere(std::span<const Eigen::Vector3f> points);

}  // namespace antipode
