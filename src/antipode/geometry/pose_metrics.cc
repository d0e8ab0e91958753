#include "antipode/geometry/pose_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

constexpr double kFailedDeg = 180.0;
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

std::vector<double> DefinedErrors(const ObjectErrors& object) {
  std::vector<double> defined;
  for (const std::optional<double>& error : object.errors) {
    if (error) defined.push_back(*error);
  }
  return defined;
}

double MeanOf(std::span<const double> values) {
  if (values.empty()) return kNothing;
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace

double RotationErrorDeg(const Eigen::Matrix3d& estimate, const Eigen::Matrix3d& truth) {
  return estimate.allFinite() ? AngleBetweenDeg(estimate, truth) : kFailedDeg;
}

std::optional<double> TranslationDirectionErrorDeg(const Eigen::Vector3d& estimate,
                                                   const Eigen::Vector3d& truth) {
  if (truth.isZero(0.0)) return std::nullopt;
  if (!estimate.allFinite() || estimate.isZero(0.0)) return kFailedDeg;
  const Eigen::Vector3d a = estimate.stableNormalized();
  const Eigen::Vector3d b = truth.stableNormalized();
  return DegreesFromRadians(std::atan2(a.cross(b).norm(), a.dot(b)));
}

double PublishedTranslationErrorDeg(const Eigen::Vector3d& estimate, const Eigen::Vector3d& truth) {
  return DegreesFromRadians(std::acos(estimate.dot(truth) / (estimate.norm() * truth.norm())));
}

double FractionBelow(std::span<const double> errors, double threshold) {
  if (errors.empty()) return kNothing;
  const auto below =
      std::count_if(errors.begin(), errors.end(), [&](double error) { return error < threshold; });
  return static_cast<double>(below) / static_cast<double>(errors.size());
}

double Median(std::span<const double> values) {
  if (values.empty()) return kNothing;
  std::vector<double> sorted(values.begin(), values.end());
  std::replace_if(
      sorted.begin(), sorted.end(), [](double value) { return std::isnan(value); },
      std::numeric_limits<double>::infinity());
  std::sort(sorted.begin(), sorted.end());
  const std::size_t middle = sorted.size() / 2;
  if (sorted.size() % 2 == 1) return sorted[middle];
  return (sorted[middle - 1] + sorted[middle]) / 2.0;
}

ErrorSummary SummarizeErrors(std::span<const ObjectErrors> objects,
                             std::span<const double> thresholds) {
  ErrorSummary summary;
  std::vector<std::vector<double>> errors_of_object;
  std::vector<double> all;
  for (const ObjectErrors& object : objects) {
    const std::vector<double> defined = DefinedErrors(object);
    summary.pairs += object.errors.size();
    summary.undefined += object.errors.size() - defined.size();
    all.insert(all.end(), defined.begin(), defined.end());
    if (!defined.empty()) errors_of_object.push_back(defined);
  }
  for (const double threshold : thresholds) {
    std::vector<double> fractions;
    for (const std::vector<double>& errors : errors_of_object) {
      fractions.push_back(FractionBelow(errors, threshold));
    }
    summary.accuracy.push_back(MeanOf(fractions));
  }
  summary.median = Median(all);
  return summary;
}

}  // namespace antipode
