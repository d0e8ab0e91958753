#include "antipode/weights/check.h"

#include <algorithm>

#include "antipode/util/error.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

constexpr std::size_t kMaxListed = 20;

template <typename File>
std::vector<std::string> FindProblems(const File& file,
                                      const std::map<std::string, TensorShape>& expected) {
  std::vector<std::string> problems;
  for (const auto& [name, shape] : expected) {
    const auto found = file.tensors.find(name);
    if (found == file.tensors.end()) {
      problems.push_back(Quoted(name) + " is missing");
    } else if (found->second.shape != shape) {
      problems.push_back(Quoted(name) + " has shape " + ShapeText(found->second.shape) +
                         " instead of " + ShapeText(shape));
    }
  }
  for (const auto& [name, tensor] : file.tensors) {
    if (!expected.contains(name)) problems.push_back(Quoted(name) + " does not belong there");
  }
  return problems;
}

/// Exponent bits that are all set mean NaN or infinity.
template <typename Bits>
bool AllBelowExponent(std::span<const Bits> values, Bits exponent) {
  return std::none_of(values.begin(), values.end(),
                      [exponent](Bits bits) { return (bits & exponent) == exponent; });
}

template <typename T>
std::span<const T> As(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T)};
}

bool IsFinite(std::span<const std::byte> bytes, Dtype dtype) {
  switch (dtype) {
    case Dtype::kF64:
      return AllBelowExponent<std::uint64_t>(As<std::uint64_t>(bytes), 0x7ff0'0000'0000'0000);
    case Dtype::kF32:
      return AllBelowExponent<std::uint32_t>(As<std::uint32_t>(bytes), 0x7f80'0000);
    case Dtype::kF16:
      return AllBelowExponent<std::uint16_t>(As<std::uint16_t>(bytes), 0x7c00);
    case Dtype::kBF16:
      return AllBelowExponent<std::uint16_t>(As<std::uint16_t>(bytes), 0x7f80);
    default:
      return true;
  }
}

void ThrowIfAny(const std::vector<std::string>& problems, const std::string& file_name) {
  if (problems.empty()) return;
  std::string listed;
  for (std::size_t i = 0; i < std::min(problems.size(), kMaxListed); ++i) {
    listed += (i == 0 ? "" : ", ") + problems[i];
  }
  if (problems.size() > kMaxListed) {
    listed += ", and " + std::to_string(problems.size() - kMaxListed) + " more";
  }
  throw BadFile(file_name, "the weights do not fit this network: " + listed,
                "give the weights of this network and version");
}

}  // namespace

void CheckTensors(const TensorFile& file, const std::map<std::string, TensorShape>& expected,
                  const std::string& file_name) {
  ThrowIfAny(FindProblems(file, expected), file_name);
}

void CheckTensors(const LazyTensorFile& file, const std::map<std::string, TensorShape>& expected,
                  const std::string& file_name) {
  ThrowIfAny(FindProblems(file, expected), file_name);
}

void CheckFinite(const TensorFile& file, const std::string& file_name) {
  for (const auto& [name, tensor] : file.tensors) CheckFinite(tensor, name, file_name);
}

void CheckFinite(const HostTensor& tensor, const std::string& name, const std::string& file_name) {
  CheckFinite(tensor.data, tensor.dtype, name, file_name);
}

void CheckFinite(std::span<const std::byte> values, Dtype dtype, const std::string& name, const std::string& file_name) {
  if (IsFinite(values, dtype)) return;
  throw BadFile(file_name, "tensor " + Quoted(name) + " has a value that is not finite",
                "get the file again or repeat the training");
}

std::string ShapeText(const TensorShape& shape) {
  std::string text = "[";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    text += (i == 0 ? "" : ", ") + std::to_string(shape[i]);
  }
  return text + "]";
}

}  // namespace antipode
