#pragma once

#include <limits>
#include <string>

#include "manifest.h"
#include "numeric_tensor.h"

namespace antipode::golden {

/// What a tensor may differ by; every limit that is set must hold.
struct Tolerance {
  double max_abs = std::numeric_limits<double>::infinity();  ///< 0: exact
  double rel_l2 = std::numeric_limits<double>::infinity();
  double mean_abs = std::numeric_limits<double>::infinity();
  double max_fraction_different = 1;

  double Main() const;  ///< the limit of the largest difference, or else of the mean difference
  std::string Text()
      const;  ///< all limits in one word, e.g. "exact" or "max_abs<=1e-06,rel_l2<=1e-05"
};

/// Understands every form the manifests use: "atol": number (the mean difference for 8-bit
/// pictures); "tolerance": "exact", "8-bit image: max N grey levels", or an object of kind float,
/// grey_levels, exact.
/// @throws Error naming the tensor if none of these is there
Tolerance ToleranceOf(const TensorSpec& spec);

struct Difference {
  double max_abs = 0;  ///< infinite where shapes differ or only one of two values is NaN
  double rel_l2 = 0;   ///< ||result - expected|| / ||expected||
  double mean_abs = 0;
  double fraction_different = 0;

  /// The largest ratio of a difference to its limit: at most 1 if all hold.
  double RatioTo(const Tolerance& tolerance) const;
};

/// NaN equals NaN, and an infinity equals itself.
Difference Compare(const NumericTensor& result, const NumericTensor& expected);

}  // namespace antipode::golden
