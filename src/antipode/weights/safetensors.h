#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "antipode/util/memory_map.h"

namespace antipode {

enum class Dtype { kF64, kF32, kF16, kBF16, kI64, kI32, kI16, kI8, kU8, kBool };

std::size_t SizeOf(Dtype dtype);
const char* Name(Dtype dtype);  ///< as in the safetensors header: "F32", "BF16", ...

/// One tensor, row-major, little-endian, owned.
struct HostTensor {
  Dtype dtype = Dtype::kF32;
  std::vector<std::int64_t> shape;
  std::vector<std::byte> data;

  std::int64_t NumElements() const;
  template <typename T>
  std::span<const T> As() const {
    return {reinterpret_cast<const T*>(data.data()), data.size() / sizeof(T)};
  }
  /// The values as double, whatever the (numeric) dtype.
  std::vector<double> ToDouble() const;
  /// From values in memory.
  static HostTensor FromFloat(std::vector<std::int64_t> shape, std::span<const float> values);
  static HostTensor FromDouble(std::vector<std::int64_t> shape, std::span<const double> values);
};

/// The same values in another floating dtype, rounded to nearest, ties to even.
/// @throws Error if either dtype is not a floating one
HostTensor ConvertTo(const HostTensor& tensor, Dtype dtype);

enum class TensorLayout {
  kRowMajor,
  kChannelsLast,  ///< a tensor [K, C, h, w] stored as [K, h, w, C]
};

/// Values of a mapped file as they are stored, which keep it mapped.
struct MappedValues {
  std::shared_ptr<const MemoryMap> file;  ///< null: there are none
  std::span<const std::byte> bytes;
  TensorLayout layout = TensorLayout::kRowMajor;
};

/// Tensors that are read when they are needed: files may be larger than the memory.
struct LazyTensor {
  Dtype dtype = Dtype::kF32;
  std::vector<std::int64_t> shape;
  std::function<HostTensor()> read;
  MappedValues mapped = {};  ///< the same values without a copy
};

/// [K, C, h, w] as [K, h, w, C], and back; the latter keeps what is mapped.
LazyTensor ToChannelsLast(const LazyTensor& tensor);
LazyTensor FromChannelsLast(const LazyTensor& tensor);

struct LazyTensorFile {
  std::map<std::string, LazyTensor> tensors;
  std::map<std::string, std::string> metadata;
};

struct TensorInfo {
  Dtype dtype = Dtype::kF32;
  std::vector<std::int64_t> shape;
  std::uint64_t begin = 0;  ///< byte offsets into the data section
  std::uint64_t end = 0;
};

struct TensorFile {
  std::map<std::string, HostTensor> tensors;
  std::map<std::string, std::string> metadata;
};

/// A safetensors file whose header has been validated entirely: header length within the file,
/// UTF-8 JSON, known dtypes, shapes that multiply without overflow to exactly the byte range,
/// ranges in bounds, not overlapping, and without holes. Nothing is allocated from an unvalidated
/// number.
class SafetensorsReader {
 public:
  /// @throws BadFile naming the file and the first tensor at fault
  explicit SafetensorsReader(std::filesystem::path path);

  const std::map<std::string, TensorInfo>& tensors() const { return infos_; }
  const std::map<std::string, std::string>& metadata() const { return metadata_; }
  HostTensor Read(const std::string& name) const;  ///< @throws BadFile if it is not there
  /// The bytes of a tensor in the file. @throws BadFile if it is not there
  std::span<const std::byte> BytesIn(const MemoryMap& file, const std::string& name) const;
  TensorFile ReadAll() const;

 private:
  const TensorInfo& Find(const std::string& name) const;

  std::filesystem::path path_;
  std::uint64_t data_offset_ = 0;
  std::map<std::string, TensorInfo> infos_;
  std::map<std::string, std::string> metadata_;
};

/// Refers to `file`, which must live as long.
LazyTensorFile LazyViewOf(const TensorFile& file);
/// Keeps the tensors in memory.
LazyTensorFile LazyCopyOf(TensorFile file);

/// The tensors of a safetensors file, mapped into memory.
LazyTensorFile OpenSafetensors(const std::filesystem::path& path);

/// Writes to a temporary file beside `path`, then renames. Tensors are stored in name order; lazy ones are read
/// one after the other.
/// @throws Error naming `path` and the tensor whose data contradict its shape, or why it cannot be
/// written
void WriteSafetensors(const std::filesystem::path& path, const TensorFile& file);
void WriteSafetensors(const std::filesystem::path& path, const LazyTensorFile& file);

}  // namespace antipode
