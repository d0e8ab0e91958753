#include "antipode/render/enclosing_sphere.h"

#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Dense>

namespace antipode {
namespace {

constexpr double kTolerance = 1e-9;  // relative to the radius

using Points = std::vector<Eigen::Vector3d>;

bool Holds(const Sphere& sphere, const Eigen::Vector3d& point) {
  return (point - sphere.centre).norm() <= sphere.radius * (1 + kTolerance) + 1e-300;
}

/// The sphere through 1 to 4 points with its centre in the space they span; none if they are
/// affinely dependent. With Q the differences to the first point p, the centre is p + Q l where
/// 2 Q^T Q l = diag(Q^T Q).
std::optional<Sphere> Circumsphere(const Points& points) {
  const auto count = static_cast<Eigen::Index>(points.size()) - 1;
  if (count == 0) return Sphere{points[0], 0};
  Eigen::Matrix<double, 3, Eigen::Dynamic> differences(3, count);
  for (Eigen::Index i = 0; i < count; ++i) differences.col(i) = points[i + 1] - points[0];
  const Eigen::MatrixXd gram = differences.transpose() * differences;
  const Eigen::FullPivLU<Eigen::MatrixXd> solver(2 * gram);
  if (!solver.isInvertible()) return std::nullopt;
  const Eigen::Vector3d offset = differences * solver.solve(gram.diagonal());
  return Sphere{points[0] + offset, offset.norm()};
}

struct SupportedSphere {
  Sphere sphere;
  Points support;  // the points that the sphere is spanned by
};

/// The smallest sphere around at most 5 points: the smallest circumsphere of a subset that holds
/// them all.
std::optional<SupportedSphere> SmallestOfFew(const Points& points) {
  std::optional<SupportedSphere> best;
  for (unsigned subset = 1; subset < (1u << points.size()); ++subset) {
    if (std::popcount(subset) > 4) continue;
    Points chosen;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (subset >> i & 1) chosen.push_back(points[i]);
    }
    const std::optional<Sphere> sphere = Circumsphere(chosen);
    if (!sphere || (best && sphere->radius >= best->sphere.radius)) continue;
    bool holds_all = true;
    for (const Eigen::Vector3d& point : points) holds_all = holds_all && Holds(*sphere, point);
    if (holds_all) best = SupportedSphere{*sphere, chosen};
  }
  return best;
}

Eigen::Vector3d Farthest(std::span<const Eigen::Vector3f> points, const Eigen::Vector3d& from) {
  const Eigen::Vector3f* farthest = &points[0];
  double largest = -1;
  for (const Eigen::Vector3f& point : points) {
    const double distance = (point.cast<double>() - from).squaredNorm();
    if (distance <= largest) continue;
    largest = distance;
    farthest = &point;
  }
  return farthest->cast<double>();
}

}  // namespace

Sphere SmallestEnclosingSphere(std::span<const Eigen::Vector3f> points) {
  if (points.empty()) return {};
  SupportedSphere current{{points[0].cast<double>(), 0}, {points[0].cast<double>()}};
  // The radius grows with each point taken in, so no support comes twice.
  while (true) {
    const Eigen::Vector3d farthest = Farthest(points, current.sphere.centre);
    if (Holds(current.sphere, farthest)) return current.sphere;
    Points candidates = current.support;
    candidates.push_back(farthest);
    const std::optional<SupportedSphere> larger = SmallestOfFew(candidates);
    if (!larger || larger->sphere.radius <= current.sphere.radius) {
      // Rounding has the last word: keep the centre and reach the farthest point.
      return {current.sphere.centre, (farthest - current.sphere.centre).norm()};
    }
    current = *larger;
  }
}

}  // namespace antipode
