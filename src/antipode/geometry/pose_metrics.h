#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace antipode {

/// Angle of the rotation between estimate and truth in degrees, 0..180.
/// An estimate that is not finite has failed: 180.
double RotationErrorDeg(const Eigen::Matrix3d& estimate, const Eigen::Matrix3d& truth);

/// Angle between the two translation directions in degrees, 0..180, without sign ambiguity.
/// Nothing if the true translation is zero: it has no direction. An estimate that is zero or not
/// finite has failed: 180.
std::optional<double> TranslationDirectionErrorDeg(const Eigen::Vector3d& estimate,
                                                   const Eigen::Vector3d& truth);

/// The published program's formula, arccos(a.b / (|a| |b|)) without clipping: NaN where a vector is
/// zero or the cosine exceeds one. For fidelity checks only.
double PublishedTranslationErrorDeg(const Eigen::Vector3d& estimate, const Eigen::Vector3d& truth);

/// Fraction (0..1) of the errors strictly below `threshold`; NaN counts as a failure. NaN if there
/// are none.
double FractionBelow(std::span<const double> errors, double threshold);

/// The middle value, or the mean of the two middle ones. NaN counts as infinite. NaN if there are
/// none.
double Median(std::span<const double> values);

/// The errors of one kind (degrees) of all pairs of one object.
struct ObjectErrors {
  std::string object;
  std::vector<std::optional<double>> errors;  ///< nothing where the error is undefined
};

struct ErrorSummary {
  std::size_t pairs = 0;      ///< all of them
  std::size_t undefined = 0;  ///< of these, left out of the figures
  std::vector<double>
      accuracy;  ///< fraction below each threshold: mean over pairs of an object, then over objects
  double median = 0;  ///< degrees, over all defined errors
};

/// Objects without any defined error are left out of the mean.
ErrorSummary SummarizeErrors(std::span<const ObjectErrors> objects,
                             std::span<const double> thresholds);

}  // namespace antipode
