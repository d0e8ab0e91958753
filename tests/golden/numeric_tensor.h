#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "antipode/weights/safetensors.h"

namespace antipode::golden {

/// A tensor of any numeric type, widened to double; row-major.
struct NumericTensor {
  std::vector<std::int64_t> shape;
  std::vector<double> values;

  NumericTensor() = default;
  explicit NumericTensor(std::vector<std::int64_t> dimensions) : shape(std::move(dimensions)) {}
  explicit NumericTensor(const HostTensor& tensor)
      : shape(tensor.shape), values(tensor.ToDouble()) {}
};

using NumericTensors = std::map<std::string, NumericTensor>;

}  // namespace antipode::golden
