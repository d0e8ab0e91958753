#include "antipode/geometry/viewpoints.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

Eigen::Vector3d MeanOf(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

/// Lowers each distance to that from `taken`, if it is nearer.
void LowerDistances(std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& taken,
                    std::vector<double>& distances) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    distances[i] = std::min(distances[i], (points[i] - taken).norm());
  }
}

}  // namespace

std::vector<CanonicalDirection> PredefinedViewpoints(int count) {
  if (count <= 0) {
    throw InvalidOption("views", "is " + std::to_string(count), "ask for at least one view");
  }
  const double turn = (std::sqrt(5.0) - 1.0) / 2.0;
  std::vector<CanonicalDirection> viewpoints;
  viewpoints.reserve(count);
  for (int i = 0; i < count; ++i) {
    const double height = static_cast<double>(i) / count;
    const double angle = 2.0 * std::numbers::pi * (count + i) * turn;
    viewpoints.push_back({std::asin(height), std::fmod(angle, 2.0 * std::numbers::pi)});
  }
  return viewpoints;
}

Eigen::Matrix3d CameraRotationFromCanonical(const CanonicalDirection& direction) {
  const double sin_e = std::sin(direction.elevation), cos_e = std::cos(direction.elevation);
  const double sin_a = std::sin(direction.azimuth), cos_a = std::cos(direction.azimuth);
  Eigen::Matrix3d rotation;
  rotation << -sin_a, cos_a, 0,              //
      sin_e * cos_a, sin_e * sin_a, -cos_e,  //
      -cos_e * cos_a, -cos_e * sin_a, -sin_e;
  return rotation;
}

Rigid3 CameraFromCanonical(const CanonicalDirection& direction, double distance) {
  return {CameraRotationFromCanonical(direction), {0, 0, distance}};
}

RelativeView RelativeViewOf(const CanonicalDirection& direction, double reference_elevation_deg) {
  return {.polar = reference_elevation_deg - DegreesFromRadians(direction.elevation),
          .azimuth = std::fmod(DegreesFromRadians(direction.azimuth), 360.0)};
}

Eigen::Matrix3d CanonicalFromObjectRotation() {
  Eigen::Matrix3d rotation;
  rotation << 0, 0, 1,  //
      1, 0, 0,          //
      0, 1, 0;
  return rotation;
}

std::vector<std::size_t> FarthestPointOrder(std::span<const Eigen::Vector3d> points) {
  if (points.empty()) return {};
  std::vector<std::size_t> order;
  std::vector<double> distances(points.size(), HUGE_VAL);
  LowerDistances(points, MeanOf(points), distances);
  while (order.size() + 1 < points.size()) {
    const auto farthest = std::max_element(distances.begin(), distances.end());
    order.push_back(std::distance(distances.begin(), farthest));
    LowerDistances(points, points[order.back()], distances);
  }
  return order;
}

}  // namespace antipode
