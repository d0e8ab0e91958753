#include "antipode/render/mesh_encoding.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "antipode/render/srgb.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

static_assert(std::endian::native == std::endian::little, "headers are copied as they lie in memory");

constexpr std::uint32_t kHasTexcoords = 1, kHasColors = 2;
constexpr std::size_t kMostVerticesOfShortIndices = 65536;
constexpr int kOctahedralSteps = 511;  // on both sides of 0, so that the axes are kept exactly

struct Header {
  std::uint32_t vertices = 0, triangles = 0, materials = 0, flags = 0;
};

struct MaterialRecord {
  float base_color[3] = {};
  std::uint32_t texture = kNoTexture;
};

/// What the whole encoding takes, so that it is known before anything is allocated.
std::uint64_t EncodedSize(const Header& header) {
  const std::uint64_t vertices = header.vertices, triangles = header.triangles;
  const std::uint64_t index_bytes = vertices <= kMostVerticesOfShortIndices ? 2 : 4;
  std::uint64_t size = sizeof(Header) + sizeof(MaterialRecord) * std::uint64_t{header.materials};
  size += 4 * sizeof(float) + vertices * (3 + 2) * 2;
  if (header.flags & kHasTexcoords) size += 4 * sizeof(float) + vertices * 2 * 2;
  if (header.flags & kHasColors) size += sizeof(float) + vertices * 3;
  return size + triangles * (3 * index_bytes + 2);
}

/// Differences of either sign as small numbers.
template <typename Unsigned>
Unsigned ZigzagOf(Unsigned difference) {
  const bool is_negative = difference >> (8 * sizeof(Unsigned) - 1);
  const auto doubled = static_cast<Unsigned>(difference << 1);
  return is_negative ? static_cast<Unsigned>(~doubled) : doubled;
}

template <typename Unsigned>
Unsigned FromZigzag(Unsigned code) {
  const auto half = static_cast<Unsigned>(code >> 1);
  return code & 1 ? static_cast<Unsigned>(~half) : half;
}

/// What a number is expected to be: the one before it.
template <typename Unsigned>
class PreviousNumber {
 public:
  Unsigned Expected() const { return previous_; }
  void See(Unsigned number) { previous_ = number; }

 private:
  Unsigned previous_ = 0;
};

/// Or, as triangles mostly take the next vertex that none has yet: one more than the greatest so far.
template <typename Unsigned>
class NextVertex {
 public:
  Unsigned Expected() const { return next_; }
  void See(Unsigned number) { next_ = std::max(next_, static_cast<Unsigned>(number + 1)); }

 private:
  Unsigned next_ = 0;
};

class ByteWriter {
 public:
  template <typename Value>
  void Put(const Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    const auto* first = reinterpret_cast<const std::byte*>(&value);
    bytes_.insert(bytes_.end(), first, first + sizeof(Value));
  }

  template <template <typename> typename Predictor, typename Unsigned>
  void PutColumn(std::vector<Unsigned> numbers) {
    Predictor<Unsigned> predictor;
    for (Unsigned& number : numbers) {
      const auto difference = static_cast<Unsigned>(number - predictor.Expected());
      predictor.See(number);
      number = ZigzagOf(difference);
    }
    for (std::size_t shift = 0; shift < 8 * sizeof(Unsigned); shift += 8)
      for (const Unsigned number : numbers) bytes_.push_back(static_cast<std::byte>(number >> shift));
  }

  std::vector<std::byte> Take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

/// The caller has compared the size with EncodedSize; what is read lies in the bytes.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : rest_(bytes) {}

  template <typename Value>
  Value Get() {
    Value value;
    std::memcpy(&value, Next(sizeof(Value)).data(), sizeof(Value));
    return value;
  }

  template <template <typename> typename Predictor, typename Unsigned>
  std::vector<Unsigned> GetColumn(std::size_t count) {
    std::vector<Unsigned> numbers(count);
    for (std::size_t shift = 0; shift < 8 * sizeof(Unsigned); shift += 8) {
      const auto plane = Next(count);
      for (std::size_t i = 0; i < count; ++i)
        numbers[i] = static_cast<Unsigned>(numbers[i] | static_cast<Unsigned>(plane[i]) << shift);
    }
    Predictor<Unsigned> predictor;
    for (Unsigned& number : numbers) {
      number = static_cast<Unsigned>(predictor.Expected() + FromZigzag(number));
      predictor.See(number);
    }
    return numbers;
  }

 private:
  std::span<const std::byte> Next(std::size_t count) {
    if (count > rest_.size()) throw Error("mesh", "ends too early");
    const auto next = rest_.first(count);
    rest_ = rest_.subspan(count);
    return next;
  }

  std::span<const std::byte> rest_;
};

/// The numbers lowest + i step, i = 0..65535.
struct Steps {
  float lowest = 0, step = 0;

  static float StepOver(float lowest, float highest) {
    return static_cast<float>((static_cast<double>(highest) - lowest) / 65535);
  }

  std::uint16_t NumberOf(float value) const {
    if (!(step > 0)) return 0;
    const double number = std::round((static_cast<double>(value) - lowest) / step);
    return static_cast<std::uint16_t>(std::clamp(number, 0.0, 65535.0));
  }

  float At(std::uint16_t number) const { return static_cast<float>(lowest + static_cast<double>(step) * number); }
};

template <typename Vector>
struct Box {
  Vector lowest, highest;

  explicit Box(const std::vector<Vector>& values) : lowest(values.front()), highest(values.front()) {
    for (const Vector& value : values) {
      lowest = lowest.cwiseMin(value);
      highest = highest.cwiseMax(value);
    }
  }
};

/// @param number_of of an element; its type is the column's
template <typename Vector, typename Function>
void PutNumbers(ByteWriter& writer, const std::vector<Vector>& values, const Function& number_of) {
  using Unsigned = std::invoke_result_t<Function, const Vector&>;
  std::vector<Unsigned> numbers;
  numbers.reserve(values.size());
  for (const Vector& value : values) numbers.push_back(number_of(value));
  writer.PutColumn<PreviousNumber>(std::move(numbers));
}

void PutPositions(ByteWriter& writer, const std::vector<Eigen::Vector3f>& positions) {
  const Box<Eigen::Vector3f> box(positions);
  float step = 0;
  for (int axis = 0; axis < 3; ++axis) step = std::max(step, Steps::StepOver(box.lowest[axis], box.highest[axis]));
  for (const float lowest : box.lowest) writer.Put(lowest);
  writer.Put(step);
  for (int axis = 0; axis < 3; ++axis) {
    const Steps steps{box.lowest[axis], step};
    PutNumbers(writer, positions, [&](const Eigen::Vector3f& value) { return steps.NumberOf(value[axis]); });
  }
}

std::vector<Eigen::Vector3f> GetPositions(ByteReader& reader, std::size_t count) {
  std::array<Steps, 3> steps;
  for (Steps& axis : steps) axis.lowest = reader.Get<float>();
  const auto step = reader.Get<float>();
  for (Steps& axis : steps) axis.step = step;
  std::vector<Eigen::Vector3f> positions(count);
  for (int axis = 0; axis < 3; ++axis) {
    const auto numbers = reader.GetColumn<PreviousNumber, std::uint16_t>(count);
    for (std::size_t i = 0; i < count; ++i) positions[i][axis] = steps[axis].At(numbers[i]);
  }
  return positions;
}

/// Two numbers -511..511, modulo 2^16.
using OctahedralCode = std::array<std::uint16_t, 2>;

/// Of the octahedron |x| + |y| + |z| = 1 the lower half is folded outwards into the corners of the square of x and y.
Eigen::Vector2f Folded(const Eigen::Vector2f& point) {
  return {(1 - std::abs(point.y())) * std::copysign(1.f, point.x()), (1 - std::abs(point.x())) * std::copysign(1.f, point.y())};
}

OctahedralCode OctahedralCodeOf(const Eigen::Vector3f& normal) {
  const float sum = normal.cwiseAbs().sum();
  if (!(sum > 0) || !std::isfinite(sum)) return {};
  const Eigen::Vector2f point = normal.head<2>() / sum;
  const Eigen::Vector2f unfolded = normal.z() < 0 ? Folded(point) : point;
  OctahedralCode code;
  for (int axis = 0; axis < 2; ++axis)
    code[axis] = static_cast<std::uint16_t>(std::lround(unfolded[axis] * kOctahedralSteps));
  return code;
}

Eigen::Vector3f NormalOf(const OctahedralCode& code) {
  Eigen::Vector2f point;
  for (int axis = 0; axis < 2; ++axis)
    point[axis] = static_cast<float>(static_cast<std::int16_t>(code[axis])) / kOctahedralSteps;
  const float height = 1 - point.cwiseAbs().sum();
  if (height < 0) point = Folded(point);
  return Eigen::Vector3f(point.x(), point.y(), height).normalized();
}

void PutNormals(ByteWriter& writer, const std::vector<Eigen::Vector3f>& normals) {
  for (int axis = 0; axis < 2; ++axis)
    PutNumbers(writer, normals, [axis](const Eigen::Vector3f& normal) { return OctahedralCodeOf(normal)[axis]; });
}

std::vector<Eigen::Vector3f> GetNormals(ByteReader& reader, std::size_t count) {
  const auto x = reader.GetColumn<PreviousNumber, std::uint16_t>(count);
  const auto y = reader.GetColumn<PreviousNumber, std::uint16_t>(count);
  std::vector<Eigen::Vector3f> normals(count);
  for (std::size_t i = 0; i < count; ++i) normals[i] = NormalOf({x[i], y[i]});
  return normals;
}

void PutTexcoords(ByteWriter& writer, const std::vector<Eigen::Vector2f>& texcoords) {
  const Box<Eigen::Vector2f> box(texcoords);
  std::array<Steps, 2> steps;
  for (int axis = 0; axis < 2; ++axis)
    steps[axis] = {box.lowest[axis], Steps::StepOver(box.lowest[axis], box.highest[axis])};
  writer.Put(steps);
  for (int axis = 0; axis < 2; ++axis)
    PutNumbers(writer, texcoords, [&](const Eigen::Vector2f& value) { return steps[axis].NumberOf(value[axis]); });
}

std::vector<Eigen::Vector2f> GetTexcoords(ByteReader& reader, std::size_t count) {
  const auto steps = reader.Get<std::array<Steps, 2>>();
  std::vector<Eigen::Vector2f> texcoords(count);
  for (int axis = 0; axis < 2; ++axis) {
    const auto numbers = reader.GetColumn<PreviousNumber, std::uint16_t>(count);
    for (std::size_t i = 0; i < count; ++i) texcoords[i][axis] = steps[axis].At(numbers[i]);
  }
  return texcoords;
}

const SrgbTables& Srgb() {
  static const SrgbTables tables;
  return tables;
}

void PutColors(ByteWriter& writer, const std::vector<Eigen::Vector3f>& colors) {
  const float brightest = std::max(1.f, Box<Eigen::Vector3f>(colors).highest.maxCoeff());
  writer.Put(brightest);
  for (int channel = 0; channel < 3; ++channel)
    PutNumbers(writer, colors, [&](const Eigen::Vector3f& color) { return Srgb().Encoded(color[channel] / brightest); });
}

std::vector<Eigen::Vector3f> GetColors(ByteReader& reader, std::size_t count) {
  const auto brightest = reader.Get<float>();
  std::vector<Eigen::Vector3f> colors(count);
  for (int channel = 0; channel < 3; ++channel) {
    const auto encoded = reader.GetColumn<PreviousNumber, std::uint8_t>(count);
    for (std::size_t i = 0; i < count; ++i) colors[i][channel] = brightest * Srgb().Linear(encoded[i]);
  }
  return colors;
}

template <typename Unsigned>
void PutTriangles(ByteWriter& writer, const Mesh& mesh) {
  std::vector<Unsigned> corners;
  corners.reserve(3 * mesh.triangles.size());
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t vertex : triangle) corners.push_back(static_cast<Unsigned>(vertex));
  writer.PutColumn<NextVertex>(std::move(corners));
}

template <typename Unsigned>
void GetTriangles(ByteReader& reader, std::size_t count, Mesh& mesh) {
  const auto corners = reader.GetColumn<NextVertex, Unsigned>(3 * count);
  mesh.triangles.reserve(count);
  for (std::size_t i = 0; i < corners.size(); i += 3) mesh.triangles.emplace_back(corners[i], corners[i + 1], corners[i + 2]);
}

Header HeaderOf(const Mesh& mesh) {
  Header header;
  header.vertices = static_cast<std::uint32_t>(mesh.positions.size());
  header.triangles = static_cast<std::uint32_t>(mesh.triangles.size());
  header.materials = static_cast<std::uint32_t>(mesh.materials.size());
  header.flags = (mesh.texcoords.empty() ? 0 : kHasTexcoords) | (mesh.colors.empty() ? 0 : kHasColors);
  return header;
}

Header CheckedHeader(std::span<const std::byte> bytes) {
  if (bytes.size() < sizeof(Header)) throw Error("mesh", "ends too early");
  const auto header = ByteReader(bytes).Get<Header>();
  if (header.flags & ~(kHasTexcoords | kHasColors)) throw Error("mesh", "has unknown parts");
  if (bytes.size() != EncodedSize(header)) throw Error("mesh", "is not as long as its header says");
  return header;
}

}  // namespace

std::vector<std::byte> EncodeMesh(const Mesh& mesh, std::span<const std::uint32_t> textures) {
  mesh.Check();
  if (textures.size() != mesh.materials.size()) throw Error("mesh", "must have one texture number a material");
  ByteWriter writer;
  writer.Put(HeaderOf(mesh));
  for (std::size_t i = 0; i < textures.size(); ++i) {
    const Eigen::Vector3f& color = mesh.materials[i].base_color;
    writer.Put(MaterialRecord{{color.x(), color.y(), color.z()}, textures[i]});
  }
  PutPositions(writer, mesh.positions);
  PutNormals(writer, mesh.normals);
  if (!mesh.texcoords.empty()) PutTexcoords(writer, mesh.texcoords);
  if (!mesh.colors.empty()) PutColors(writer, mesh.colors);
  if (mesh.positions.size() <= kMostVerticesOfShortIndices) PutTriangles<std::uint16_t>(writer, mesh);
  else PutTriangles<std::uint32_t>(writer, mesh);
  writer.PutColumn<PreviousNumber>(mesh.triangle_materials);
  return writer.Take();
}

Mesh DecodeMesh(std::span<const std::byte> bytes, const std::function<cv::Mat(std::uint32_t)>& texture) {
  const Header header = CheckedHeader(bytes);
  ByteReader reader(bytes);
  reader.Get<Header>();
  Mesh mesh;
  for (std::uint32_t i = 0; i < header.materials; ++i) {
    const auto record = reader.Get<MaterialRecord>();
    const cv::Mat picture = record.texture == kNoTexture ? cv::Mat() : texture(record.texture);
    mesh.materials.push_back({Eigen::Vector3f(record.base_color), picture});
  }
  mesh.positions = GetPositions(reader, header.vertices);
  mesh.normals = GetNormals(reader, header.vertices);
  if (header.flags & kHasTexcoords) mesh.texcoords = GetTexcoords(reader, header.vertices);
  if (header.flags & kHasColors) mesh.colors = GetColors(reader, header.vertices);
  if (header.vertices <= kMostVerticesOfShortIndices) GetTriangles<std::uint16_t>(reader, header.triangles, mesh);
  else GetTriangles<std::uint32_t>(reader, header.triangles, mesh);
  mesh.triangle_materials = reader.GetColumn<PreviousNumber, std::uint16_t>(header.triangles);
  mesh.Check();
  return mesh;
}

}  // namespace antipode
