#pragma once

#include <vector>

#include <Eigen/Core>

namespace antipode {

/// `count` nearly uniform rotations: the super-Fibonacci spirals of Alexa, CVPR 2022. The mean distance
/// between neighbours is about (8 pi^2 / count)^(1/3) radians: 15 degrees for 4096, 9 for 20,000.
std::vector<Eigen::Matrix3d> SuperFibonacciRotations(int count);

}  // namespace antipode
