#include "antipode/prior/code_maps.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "antipode/prior/correlation.h"
#include "antipode/prior/mode_ranker.h"

namespace antipode {
namespace {

using torch::Tensor;

constexpr double kHalfSide = 1.1;  // of a map, in radii of the sphere

/// Points of both halves, near ones first. [2 S^2, 3]
Tensor SpherePixels(int size) {
  const Tensor line = (torch::arange(size, torch::kFloat) + 0.5) * (2 * kHalfSide / size) - kHalfSide;
  const auto axes = torch::meshgrid({line, line}, "ij");
  const Tensor x = axes[1].flatten(), y = axes[0].flatten();
  const Tensor radius = (x.square() + y.square()).sqrt(), shrink = radius.clamp_min(1);
  const Tensor z = (1 - radius.square()).clamp_min(0).sqrt();
  const auto half = [&](int side) { return torch::stack({x / shrink, y / shrink, side * z}, 1); };
  return torch::cat({half(-1), half(1)});
}

}  // namespace

Tensor ScaledCodes(const Tensor& codes) {
  const double functions = 4 * std::numbers::pi * static_cast<double>(codes.size(1));
  return codes * (std::sqrt(functions) / codes.flatten(1).norm(2, 1).clamp_min(1e-6)).view({-1, 1, 1});
}

Tensor CodeMaps(const Tensor& codes, std::span<const Eigen::Matrix3d> view_from_picture, int size) {
  const std::vector<Eigen::Matrix3d> rotations(view_from_picture.begin(), view_from_picture.end());
  const Tensor in_picture = torch::matmul(SpherePixels(size), ToTensor(rotations).to(torch::kFloat));  // rows: v^T R = (R^T v)^T
  const Tensor values = torch::matmul(ScaledCodes(codes), HarmonicsAt(in_picture, MaxDegreeOf(codes)).transpose(1, 2));  // [P, C, 2 S^2]
  return values.view({codes.size(0), codes.size(1) * 2, size, size});
}

}  // namespace antipode
