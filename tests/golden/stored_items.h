#pragma once

#include <cstdint>
#include <initializer_list>

#include <Eigen/Core>

#include "antipode/geometry/object_centric_published.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/util/error.h"
#include "numeric_tensor.h"

/// Between the tensors of a case and the types of geometry/.
namespace antipode::golden {

/// `Rows` x `Columns` values of item `index` along the first axis.
template <int Rows, int Columns>
Eigen::Matrix<double, Rows, Columns> Item(const NumericTensor& tensor, std::int64_t index) {
  constexpr std::size_t kSize = Rows * Columns;
  if (tensor.values.size() < kSize * (index + 1)) throw Error("golden input", "is too short");
  Eigen::Matrix<double, Rows, Columns> item;
  for (int row = 0; row < Rows; ++row) {
    for (int column = 0; column < Columns; ++column) {
      item(row, column) = tensor.values[kSize * index + Columns * row + column];
    }
  }
  return item;
}

inline double Number(const NumericTensor& tensor, std::int64_t index) {
  return Item<1, 1>(tensor, index)(0, 0);
}

inline std::int64_t ItemCount(const NumericTensor& tensor) {
  return tensor.shape.empty() ? 0 : tensor.shape.front();
}

template <typename Derived>
void Append(NumericTensor& tensor, const Eigen::MatrixBase<Derived>& item) {
  for (Eigen::Index row = 0; row < item.rows(); ++row) {
    for (Eigen::Index column = 0; column < item.cols(); ++column) {
      tensor.values.push_back(item(row, column));
    }
  }
}

inline void Append(NumericTensor& tensor, std::initializer_list<double> values) {
  tensor.values.insert(tensor.values.end(), values);
}

template <typename Derived>
NumericTensor Matrix(const Eigen::MatrixBase<Derived>& matrix) {
  NumericTensor tensor({matrix.rows(), matrix.cols()});
  Append(tensor, matrix);
  return tensor;
}

inline NumericTensor Vector(std::vector<double> values) {
  NumericTensor tensor({static_cast<std::int64_t>(values.size())});
  tensor.values = std::move(values);
  return tensor;
}

inline NumericTensor Scalar(double value) {
  NumericTensor tensor;
  tensor.values = {value};
  return tensor;
}

inline published::InclusiveBox Box(const NumericTensor& tensor, std::int64_t index) {
  const Eigen::Matrix<double, 4, 1> box = Item<4, 1>(tensor, index);
  return {box[0], box[1], box[2], box[3]};
}

inline Rigid3 Pose(const NumericTensor& tensor, std::int64_t index) {
  const Eigen::Matrix<double, 3, 4> pose = Item<3, 4>(tensor, index);
  return {pose.leftCols<3>(), pose.col(3)};
}

}  // namespace antipode::golden
