#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "antipode/weights/safetensors.h"

namespace antipode {

using TensorShape = std::vector<std::int64_t>;

/// The names must be exactly those of `expected`, with its shapes.
/// @throws BadFile naming `file_name` and the first 20 missing, extra or wrongly shaped tensors and
///         how many more there are
void CheckTensors(const TensorFile& file, const std::map<std::string, TensorShape>& expected,
                  const std::string& file_name);
void CheckTensors(const LazyTensorFile& file, const std::map<std::string, TensorShape>& expected,
                  const std::string& file_name);

/// @throws BadFile naming `file_name` and the first tensor with a value that is NaN or infinite
void CheckFinite(const TensorFile& file, const std::string& file_name);
void CheckFinite(const HostTensor& tensor, const std::string& name, const std::string& file_name);
void CheckFinite(std::span<const std::byte> values, Dtype dtype, const std::string& name, const std::string& file_name);

/// "[2, 3]".
std::string ShapeText(const TensorShape& shape);

}  // namespace antipode
