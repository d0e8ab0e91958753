#include "antipode/prior/fixed_point_matrix.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <ATen/Parallel.h>

#include "antipode/nn/float_pack.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr float kSteps = 32767;
constexpr std::int64_t kLeastRowsOfThread = 1024;

/// Few enough numbers for one register of AVX2; four sums side by side hide how long an addition takes.
constexpr int kWide = 8, kSums = 4;
typedef float Floats __attribute__((vector_size(4 * kWide)));
typedef std::int16_t Shorts __attribute__((vector_size(2 * kWide)));

/// products[i] = <row i, vector>, for `rows` consecutive rows. @param stride a multiple of kWide * kSums
ANTIPODE_EVERY_PROCESSOR void MultiplyRows(const std::int16_t* values, std::int64_t rows, std::int64_t stride, const float* vector,
                                           float* products) {
  for (std::int64_t row = 0; row < rows; ++row, values += stride) {
    Floats sums[kSums] = {};
    for (std::int64_t column = 0; column < stride; column += kWide * kSums) {
      for (int k = 0; k < kSums; ++k) {
        Shorts whole;
        Floats factors;
        std::memcpy(&whole, values + column + k * kWide, sizeof whole);
        std::memcpy(&factors, vector + column + k * kWide, sizeof factors);
        sums[k] += __builtin_convertvector(whole, Floats) * factors;
      }
    }
    const Floats total = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    float sum = 0;
    for (int lane = 0; lane < kWide; ++lane) sum += total[lane];
    products[row] = sum / kSteps;
  }
}

}  // namespace

FixedPointMatrix::FixedPointMatrix(Eigen::Index columns)
    : columns_(columns), stride_((columns + kWide * kSums - 1) / (kWide * kSums) * (kWide * kSums)) {}

void FixedPointMatrix::AppendRows(const RowMajorMatrixXf& rows) {
  if (rows.cols() != columns_) throw Error("fixed-point matrix", "was given rows of another length");
  for (Eigen::Index row = 0; row < rows.rows(); ++row) {
    for (const float value : rows.row(row))
      values_.push_back(static_cast<std::int16_t>(std::lround(std::clamp(value, -1.0f, 1.0f) * kSteps)));
    values_.resize(values_.size() + static_cast<std::size_t>(stride_ - columns_));
  }
}

Eigen::VectorXf FixedPointMatrix::operator*(const Eigen::VectorXf& vector) const {
  if (vector.size() != columns_) throw Error("fixed-point matrix", "was given a vector of another length");
  Eigen::VectorXf padded = Eigen::VectorXf::Zero(stride_);
  padded.head(columns_) = vector;
  Eigen::VectorXf products(rows());
  at::parallel_for(0, rows(), kLeastRowsOfThread, [&](std::int64_t begin, std::int64_t end) {
    MultiplyRows(values_.data() + begin * stride_, end - begin, stride_, padded.data(), products.data() + begin);
  });
  return products;
}

}  // namespace antipode
