#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "antipode/geometry/wigner.h"

namespace antipode {

/// A matrix of values in -1..1, stored as multiples of 1 / 32767: half the memory of single precision, and half the time of
/// a product with a vector, which waits for memory. A value errs by at most 1 / 65534.
class FixedPointMatrix {
 public:
  /// @param columns at least 1
  explicit FixedPointMatrix(Eigen::Index columns);

  /// @throws Error if a row has another length; values beyond -1..1 become the nearest end
  void AppendRows(const RowMajorMatrixXf& rows);

  /// The product with a vector; rows are shared out among the threads of LibTorch. @throws Error if the length differs
  Eigen::VectorXf operator*(const Eigen::VectorXf& vector) const;

  Eigen::Index rows() const { return static_cast<Eigen::Index>(values_.size()) / stride_; }
  Eigen::Index cols() const { return columns_; }

 private:
  Eigen::Index columns_, stride_;
  std::vector<std::int16_t> values_;  ///< row-major, rows padded with zeros to the stride
};

}  // namespace antipode
