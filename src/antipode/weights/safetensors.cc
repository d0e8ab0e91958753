#include "antipode/weights/safetensors.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/quote.h"
#include "antipode/weights/half.h"

namespace antipode {
namespace {

static_assert(std::endian::native == std::endian::little,
              "tensors are read without swapping bytes");

constexpr std::uint64_t kMaxHeaderBytes = 100'000'000;
constexpr std::size_t kMaxRank = 64;
constexpr std::size_t kLengthBytes = 8;
constexpr char kMetadataKey[] = "__metadata__";
constexpr char kDamaged[] = "the file is damaged, get it again";

struct DtypeRow {
  Dtype dtype;
  const char* name;
  std::size_t size;
};

constexpr std::array<DtypeRow, 10> kDtypes = {{{Dtype::kF64, "F64", 8},
                                               {Dtype::kF32, "F32", 4},
                                               {Dtype::kF16, "F16", 2},
                                               {Dtype::kBF16, "BF16", 2},
                                               {Dtype::kI64, "I64", 8},
                                               {Dtype::kI32, "I32", 4},
                                               {Dtype::kI16, "I16", 2},
                                               {Dtype::kI8, "I8", 1},
                                               {Dtype::kU8, "U8", 1},
                                               {Dtype::kBool, "BOOL", 1}}};

const DtypeRow& RowOf(Dtype dtype) { return kDtypes[static_cast<std::size_t>(dtype)]; }

std::optional<Dtype> DtypeNamed(const std::string& name) {
  for (const DtypeRow& row : kDtypes) {
    if (name == row.name) return row.dtype;
  }
  return std::nullopt;
}

template <typename T>
std::vector<double> Widen(std::span<const T> values) {
  return {values.begin(), values.end()};
}

template <typename Decode>
std::vector<double> WidenHalf(std::span<const std::uint16_t> values, Decode decode) {
  std::vector<double> widened(values.size());
  std::transform(values.begin(), values.end(), widened.begin(), decode);
  return widened;
}

/// Bytes of a tensor; nothing if a dimension is negative or the product does not fit.
std::optional<std::uint64_t> ByteCount(const std::vector<std::int64_t>& shape, Dtype dtype) {
  std::uint64_t count = SizeOf(dtype);
  bool is_empty = false;
  for (const std::int64_t dimension : shape) {
    if (dimension < 0) return std::nullopt;
    if (dimension == 0) {
      is_empty = true;
      continue;
    }
    const auto factor = static_cast<std::uint64_t>(dimension);
    if (count > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()) / factor) {
      return std::nullopt;
    }
    count *= factor;
  }
  return is_empty ? 0 : count;
}

struct Header {
  std::map<std::string, TensorInfo> infos;
  std::map<std::string, std::string> metadata;
};

/// Takes the events of the JSON parser and accepts nothing but the grammar of a safetensors header:
/// {name: {"dtype": string, "shape": [int...], "data_offsets": [int, int]}, "__metadata__":
/// {string: string}}.
class HeaderGrammar {
 public:
  using number_integer_t = nlohmann::json::number_integer_t;
  using number_unsigned_t = nlohmann::json::number_unsigned_t;
  using number_float_t = nlohmann::json::number_float_t;
  using string_t = nlohmann::json::string_t;
  using binary_t = nlohmann::json::binary_t;

  Header TakeHeader() { return std::move(header_); }
  const std::string& problem() const { return problem_; }

  bool null() { return Unexpected("null"); }
  bool boolean(bool) { return Unexpected("a boolean"); }
  bool number_float(number_float_t, const string_t& text) {
    return Unexpected("the number " + Quoted(text));
  }
  bool binary(binary_t&) { return Unexpected("binary data"); }
  bool number_integer(number_integer_t value) {
    return Unexpected("the negative number " + std::to_string(value));
  }

  bool number_unsigned(number_unsigned_t value) {
    if (place_ == Place::kShape) return AddDimension(value);
    if (place_ == Place::kOffsets) return AddOffset(value);
    return Unexpected("the number " + std::to_string(value));
  }

  bool string(string_t& value) {
    if (place_ == Place::kMetadata) {
      header_.metadata.at(key_) = std::move(value);
      return true;
    }
    if (place_ != Place::kEntry || field_ != "dtype")
      return Unexpected("the text " + Quoted(value));
    const std::optional<Dtype> dtype = DtypeNamed(value);
    if (!dtype) return Fail("unsupported dtype " + Quoted(value));
    info_.dtype = *dtype;
    return true;
  }

  bool start_object(std::size_t) {
    if (place_ == Place::kOutside) return Enter(Place::kTop);
    if (place_ != Place::kTop) return Unexpected("an object");
    if (key_ == kMetadataKey) return Enter(Place::kMetadata);
    info_ = {};
    fields_.clear();
    return Enter(Place::kEntry);
  }

  bool key(string_t& name) {
    if (place_ == Place::kEntry) return StartField(name);
    key_ = std::move(name);
    if (place_ == Place::kMetadata) {
      return header_.metadata.try_emplace(key_).second || Fail("appears twice in the metadata");
    }
    return names_.insert(key_).second || Fail("appears twice");
  }

  bool end_object() {
    if (place_ == Place::kMetadata) return Enter(Place::kTop);
    if (place_ == Place::kTop) return Enter(Place::kDone);
    for (const char* const field : {"dtype", "shape", "data_offsets"}) {
      if (!fields_.contains(field)) return Fail("lacks the field '" + std::string(field) + "'");
    }
    header_.infos.emplace(key_, std::move(info_));
    return Enter(Place::kTop);
  }

  bool start_array(std::size_t) {
    if (place_ != Place::kEntry) return Unexpected("an array");
    if (field_ == "shape") return Enter(Place::kShape);
    if (field_ == "data_offsets") {
      offset_count_ = 0;
      return Enter(Place::kOffsets);
    }
    return Unexpected("an array");
  }

  bool end_array() {
    if (place_ == Place::kOffsets && offset_count_ != 2) return Fail("needs two data offsets");
    return Enter(Place::kEntry);
  }

  bool parse_error(std::size_t position, const std::string&, const nlohmann::json::exception&) {
    problem_ = "the header is not valid JSON at byte " + std::to_string(position);
    return false;
  }

 private:
  enum class Place { kOutside, kTop, kMetadata, kEntry, kShape, kOffsets, kDone };

  bool Enter(Place place) {
    place_ = place;
    return true;
  }

  bool Fail(const std::string& problem) {
    problem_ = "tensor " + Quoted(key_) + " " + problem;
    return false;
  }

  bool Unexpected(const std::string& what) {
    if (place_ == Place::kOutside) {
      problem_ = "the header is not a JSON object";
      return false;
    }
    if (place_ == Place::kTop) return Fail("is not described by an object");
    if (place_ == Place::kMetadata) {
      problem_ = "the metadata " + Quoted(key_) + " is not a text";
      return false;
    }
    return Fail("has " + what + " in the field " + Quoted(field_));
  }

  bool StartField(const std::string& name) {
    field_ = name;
    if (name != "dtype" && name != "shape" && name != "data_offsets") {
      return Fail("has the unknown field " + Quoted(name));
    }
    return fields_.insert(name).second || Fail("has the field " + Quoted(name) + " twice");
  }

  bool AddDimension(std::uint64_t value) {
    if (value > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())) {
      return Fail("has the impossible dimension " + std::to_string(value));
    }
    if (info_.shape.size() == kMaxRank) return Fail("has too many dimensions");
    info_.shape.push_back(static_cast<std::int64_t>(value));
    return true;
  }

  bool AddOffset(std::uint64_t value) {
    if (offset_count_ == 2) return Fail("needs two data offsets");
    (offset_count_++ == 0 ? info_.begin : info_.end) = value;
    return true;
  }

  Header header_;
  std::string problem_;
  Place place_ = Place::kOutside;
  std::set<std::string> names_;
  std::string key_;
  TensorInfo info_;
  std::set<std::string> fields_;
  std::string field_;
  int offset_count_ = 0;
};

Header ParseHeader(const std::filesystem::path& path, const std::string& text) {
  HeaderGrammar grammar;
  const bool has_object = !text.empty() && text.front() == '{';
  if (!has_object) throw BadFile(path.string(), "the header is not a JSON object", kDamaged);
  if (!nlohmann::json::sax_parse(text, &grammar)) {
    throw BadFile(path.string(), grammar.problem(), kDamaged);
  }
  return grammar.TakeHeader();
}

std::string RangeText(const TensorInfo& info) {
  return std::to_string(info.begin) + " to " + std::to_string(info.end);
}

void CheckSize(const std::filesystem::path& path, const std::string& name, const TensorInfo& info,
               std::uint64_t data_bytes) {
  const auto fail = [&](const std::string& problem) {
    throw BadFile(path.string(), "tensor " + Quoted(name) + " " + problem, kDamaged);
  };
  if (info.begin > info.end) fail("has reversed data offsets " + RangeText(info));
  if (info.end > data_bytes) fail("lies outside the file at " + RangeText(info));
  const std::optional<std::uint64_t> needed = ByteCount(info.shape, info.dtype);
  if (!needed) fail("has an impossible shape");
  if (*needed != info.end - info.begin) {
    fail("needs " + std::to_string(*needed) + " bytes but has " +
         std::to_string(info.end - info.begin));
  }
}

/// The ranges, in order, must tile the data section exactly.
void CheckLayout(const std::filesystem::path& path, const std::map<std::string, TensorInfo>& infos,
                 std::uint64_t data_bytes) {
  std::vector<std::pair<const TensorInfo*, const std::string*>> by_offset;
  for (const auto& [name, info] : infos) by_offset.emplace_back(&info, &name);
  std::sort(by_offset.begin(), by_offset.end(), [](const auto& a, const auto& b) {
    return std::pair(a.first->begin, a.first->end) < std::pair(b.first->begin, b.first->end);
  });
  std::uint64_t covered = 0;
  for (const auto& [info, name] : by_offset) {
    if (info->begin < covered) {
      throw BadFile(path.string(), "tensor " + Quoted(*name) + " overlaps another one", kDamaged);
    }
    if (info->begin > covered) {
      throw BadFile(path.string(), "there is a hole before tensor " + Quoted(*name), kDamaged);
    }
    covered = info->end;
  }
  if (covered != data_bytes) {
    throw BadFile(
        path.string(),
        std::to_string(data_bytes - covered) + " bytes after the last tensor belong to none",
        kDamaged);
  }
}

std::uint64_t SizeOfRegularFile(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    throw BadFile(path.string(), "does not exist", "check the spelling of the path");
  }
  if (!std::filesystem::is_regular_file(status)) {
    throw BadFile(path.string(), "is not a regular file", "give the path of a safetensors file");
  }
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) throw BadFile(path.string(), "cannot be read (" + error.message() + ")");
  return size;
}

std::ifstream Open(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw BadFile(path.string(), "cannot be opened", "check the permissions");
  return stream;
}

void ReadExactly(std::istream& stream, const std::filesystem::path& path, void* target,
                 std::uint64_t count) {
  stream.read(static_cast<char*>(target), static_cast<std::streamsize>(count));
  if (!stream) throw BadFile(path.string(), "ends too early", kDamaged);
}

HostTensor ReadTensor(std::istream& stream, const std::filesystem::path& path,
                      const TensorInfo& info, std::uint64_t data_offset) {
  HostTensor tensor{info.dtype, info.shape, std::vector<std::byte>(info.end - info.begin)};
  stream.seekg(static_cast<std::streamoff>(data_offset + info.begin));
  ReadExactly(stream, path, tensor.data.data(), tensor.data.size());
  return tensor;
}

[[noreturn]] void FailToWrite(const std::filesystem::path& path, const std::string& name, const std::string& problem,
                              const std::string& remedy = {}) {
  throw Error(path.string() + ": tensor " + Quoted(name), problem, remedy);
}

std::uint64_t CheckedByteCount(const std::filesystem::path& path, const std::string& name, const LazyTensor& tensor) {
  if (name == kMetadataKey) FailToWrite(path, name, "has a reserved name", "rename it");
  if (tensor.shape.size() > kMaxRank) FailToWrite(path, name, "has too many dimensions");
  const std::optional<std::uint64_t> bytes = ByteCount(tensor.shape, tensor.dtype);
  if (!bytes) FailToWrite(path, name, "has an impossible shape");
  return *bytes;
}

std::string FormatHeader(const std::filesystem::path& path, const LazyTensorFile& file) {
  nlohmann::json header = nlohmann::json::object();
  if (!file.metadata.empty()) header[kMetadataKey] = file.metadata;
  std::uint64_t offset = 0;
  for (const auto& [name, tensor] : file.tensors) {
    const std::uint64_t end = offset + CheckedByteCount(path, name, tensor);
    header[name] = {
        {"dtype", Name(tensor.dtype)}, {"shape", tensor.shape}, {"data_offsets", {offset, end}}};
    offset = end;
  }
  std::string text;
  try {
    text = header.dump();
  } catch (const nlohmann::json::exception&) {
    throw Error(path.string(), "a tensor name or a metadata text is not UTF-8", "rename it");
  }
  // Spaces after the JSON keep the data aligned for readers that map the file.
  text.resize((text.size() + kLengthBytes - 1) / kLengthBytes * kLengthBytes, ' ');
  if (text.size() > kMaxHeaderBytes) {
    throw Error(path.string(), "the header would exceed 100 MB", "write fewer tensors");
  }
  return text;
}

}  // namespace

std::size_t SizeOf(Dtype dtype) { return RowOf(dtype).size; }

const char* Name(Dtype dtype) { return RowOf(dtype).name; }

std::int64_t HostTensor::NumElements() const {
  std::int64_t count = 1;
  for (const std::int64_t dimension : shape) count *= dimension;
  return count;
}

std::vector<double> HostTensor::ToDouble() const {
  switch (dtype) {
    case Dtype::kF64:
      return Widen(As<double>());
    case Dtype::kF32:
      return Widen(As<float>());
    case Dtype::kF16:
      return WidenHalf(As<std::uint16_t>(), FloatFromHalf);
    case Dtype::kBF16:
      return WidenHalf(As<std::uint16_t>(), FloatFromBFloat16);
    case Dtype::kI64:
      return Widen(As<std::int64_t>());
    case Dtype::kI32:
      return Widen(As<std::int32_t>());
    case Dtype::kI16:
      return Widen(As<std::int16_t>());
    case Dtype::kI8:
      return Widen(As<std::int8_t>());
    case Dtype::kU8:
    case Dtype::kBool:
      return Widen(As<std::uint8_t>());
  }
  throw Error("tensor", "has an unknown dtype");
}

namespace {

HostTensor FromBytes(Dtype dtype, std::vector<std::int64_t> shape, std::span<const std::byte> bytes) {
  const std::optional<std::uint64_t> needed = ByteCount(shape, dtype);
  if (!needed || *needed != bytes.size()) {
    throw Error("tensor", "has " + std::to_string(bytes.size()) + " bytes, which its shape contradicts");
  }
  return {dtype, std::move(shape), {bytes.begin(), bytes.end()}};
}

/// Of each of the `shape[0]` matrices of `rows` x `columns`, the transpose.
HostTensor Transposed(const HostTensor& tensor, const std::vector<std::int64_t>& shape, std::int64_t rows, std::int64_t columns) {
  HostTensor result{tensor.dtype, shape, std::vector<std::byte>(tensor.data.size())};
  const auto size = static_cast<std::int64_t>(SizeOf(tensor.dtype));
  for (std::int64_t matrix = 0; matrix < shape.front(); ++matrix) {
    const std::byte* const from = tensor.data.data() + matrix * rows * columns * size;
    std::byte* const to = result.data.data() + matrix * rows * columns * size;
    for (std::int64_t r = 0; r < rows; ++r)
      for (std::int64_t c = 0; c < columns; ++c) std::memcpy(to + (c * rows + r) * size, from + (r * columns + c) * size, static_cast<std::size_t>(size));
  }
  return result;
}

}  // namespace

HostTensor HostTensor::FromFloat(std::vector<std::int64_t> shape, std::span<const float> values) {
  return FromBytes(Dtype::kF32, std::move(shape), std::as_bytes(values));
}

HostTensor HostTensor::FromDouble(std::vector<std::int64_t> shape, std::span<const double> values) {
  return FromBytes(Dtype::kF64, std::move(shape), std::as_bytes(values));
}

HostTensor ConvertTo(const HostTensor& tensor, Dtype dtype) {
  const auto is_floating = [](Dtype d) { return d <= Dtype::kBF16; };
  if (!is_floating(tensor.dtype) || !is_floating(dtype)) {
    throw Error("tensor", std::string("cannot be converted from ") + Name(tensor.dtype) + " to " +
                              Name(dtype));
  }
  if (dtype == tensor.dtype) return tensor;
  const std::size_t count = tensor.data.size() / SizeOf(tensor.dtype);
  HostTensor converted{dtype, tensor.shape, std::vector<std::byte>(count * SizeOf(dtype))};
  // Every source value is exact in double, so each value is rounded only once.
  const auto load = [&](std::size_t i) -> double {
    switch (tensor.dtype) {
      case Dtype::kF64:
        return tensor.As<double>()[i];
      case Dtype::kF32:
        return tensor.As<float>()[i];
      case Dtype::kF16:
        return FloatFromHalf(tensor.As<std::uint16_t>()[i]);
      default:
        return FloatFromBFloat16(tensor.As<std::uint16_t>()[i]);
    }
  };
  const auto fill = [&](auto encode) {
    for (std::size_t i = 0; i < count; ++i) {
      const auto value = encode(load(i));
      std::memcpy(converted.data.data() + i * sizeof(value), &value, sizeof(value));
    }
  };
  switch (dtype) {
    case Dtype::kF64:
      fill([](double value) { return value; });
      break;
    case Dtype::kF32:
      fill([](double value) { return static_cast<float>(value); });
      break;
    case Dtype::kF16:
      fill(HalfFromDouble);
      break;
    default:
      fill(BFloat16FromDouble);
      break;
  }
  return converted;
}

SafetensorsReader::SafetensorsReader(std::filesystem::path path) : path_(std::move(path)) {
  const std::uint64_t file_bytes = SizeOfRegularFile(path_);
  if (file_bytes < kLengthBytes) {
    throw BadFile(path_.string(), "is too short for a safetensors file", kDamaged);
  }
  std::ifstream stream = Open(path_);
  std::uint64_t header_bytes = 0;
  ReadExactly(stream, path_, &header_bytes, kLengthBytes);
  if (header_bytes == 0 || header_bytes > kMaxHeaderBytes ||
      header_bytes > file_bytes - kLengthBytes) {
    throw BadFile(path_.string(),
                  "is not a safetensors file or is cut short (header of " +
                      std::to_string(header_bytes) + " bytes in a file of " +
                      std::to_string(file_bytes) + ")",
                  "give a safetensors file or get it again");
  }
  std::string text(header_bytes, '\0');
  ReadExactly(stream, path_, text.data(), header_bytes);
  Header header = ParseHeader(path_, text);
  data_offset_ = kLengthBytes + header_bytes;
  const std::uint64_t data_bytes = file_bytes - data_offset_;
  for (const auto& [name, info] : header.infos) CheckSize(path_, name, info, data_bytes);
  CheckLayout(path_, header.infos, data_bytes);
  infos_ = std::move(header.infos);
  metadata_ = std::move(header.metadata);
}

const TensorInfo& SafetensorsReader::Find(const std::string& name) const {
  const auto found = infos_.find(name);
  if (found != infos_.end()) return found->second;
  throw BadFile(path_.string(), "has no tensor " + Quoted(name), "give a file for this kind of model");
}

HostTensor SafetensorsReader::Read(const std::string& name) const {
  const TensorInfo& info = Find(name);
  std::ifstream stream = Open(path_);
  return ReadTensor(stream, path_, info, data_offset_);
}

std::span<const std::byte> SafetensorsReader::BytesIn(const MemoryMap& file, const std::string& name) const {
  const TensorInfo& info = Find(name);
  return file.bytes().subspan(data_offset_ + info.begin, info.end - info.begin);
}

TensorFile SafetensorsReader::ReadAll() const {
  TensorFile file;
  file.metadata = metadata_;
  std::ifstream stream = Open(path_);
  for (const auto& [name, info] : infos_) {
    file.tensors.emplace(name, ReadTensor(stream, path_, info, data_offset_));
  }
  return file;
}

void WriteSafetensors(const std::filesystem::path& path, const LazyTensorFile& file) {
  const std::string header = FormatHeader(path, file);
  WriteFileAtomically(path, [&](std::ostream& stream) {
    const std::uint64_t header_bytes = header.size();
    stream.write(reinterpret_cast<const char*>(&header_bytes), kLengthBytes);
    stream.write(header.data(), static_cast<std::streamsize>(header.size()));
    for (const auto& [name, lazy] : file.tensors) {
      const HostTensor tensor = lazy.read();
      if (tensor.data.size() != CheckedByteCount(path, name, lazy))
        FailToWrite(path, name, "has " + std::to_string(tensor.data.size()) + " bytes, which its shape and dtype contradict");
      stream.write(reinterpret_cast<const char*>(tensor.data.data()), static_cast<std::streamsize>(tensor.data.size()));
    }
  });
}

void WriteSafetensors(const std::filesystem::path& path, const TensorFile& file) {
  // Contradictions are found before anything is written.
  for (const auto& [name, tensor] : file.tensors)
    if (tensor.data.size() != CheckedByteCount(path, name, {tensor.dtype, tensor.shape, {}}))
      FailToWrite(path, name, "has " + std::to_string(tensor.data.size()) + " bytes, which its shape and dtype contradict");
  WriteSafetensors(path, LazyViewOf(file));
}

LazyTensorFile LazyViewOf(const TensorFile& file) {
  LazyTensorFile lazy{{}, file.metadata};
  for (const auto& [name, tensor] : file.tensors)
    lazy.tensors[name] = {tensor.dtype, tensor.shape, [&tensor = tensor] { return tensor; }};
  return lazy;
}

LazyTensorFile LazyCopyOf(TensorFile file) {
  LazyTensorFile lazy{{}, std::move(file.metadata)};
  for (auto& [name, tensor] : file.tensors) {
    auto kept = std::make_shared<const HostTensor>(std::move(tensor));
    lazy.tensors[name] = {kept->dtype, kept->shape, [kept] { return *kept; }};
  }
  return lazy;
}

LazyTensorFile OpenSafetensors(const std::filesystem::path& path) {
  const auto reader = std::make_shared<const SafetensorsReader>(path);
  LazyTensorFile file{{}, reader->metadata()};
  const auto map = std::make_shared<const MemoryMap>(path);
  for (const auto& [name, info] : reader->tensors())
    file.tensors[name] = {info.dtype, info.shape, [reader, name = name] { return reader->Read(name); },
                          {map, reader->BytesIn(*map, name)}};
  return file;
}

LazyTensor ToChannelsLast(const LazyTensor& tensor) {
  const std::int64_t outputs = tensor.shape.at(0), channels = tensor.shape.at(1), height = tensor.shape.at(2), width = tensor.shape.at(3);
  const std::vector<std::int64_t> shape{outputs, height, width, channels};
  return {tensor.dtype, shape, [read = tensor.read, shape, channels, area = height * width] {
            return Transposed(read(), shape, channels, area);
          }};
}

LazyTensor FromChannelsLast(const LazyTensor& tensor) {
  const std::int64_t outputs = tensor.shape.at(0), height = tensor.shape.at(1), width = tensor.shape.at(2), channels = tensor.shape.at(3);
  const std::vector<std::int64_t> shape{outputs, channels, height, width};
  LazyTensor result{tensor.dtype, shape, [read = tensor.read, shape, channels, area = height * width] {
                      return Transposed(read(), shape, area, channels);
                    }};
  result.mapped = tensor.mapped;
  result.mapped.layout = TensorLayout::kChannelsLast;
  return result;
}

}  // namespace antipode
