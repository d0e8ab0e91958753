#include "antipode/render/mesh_pack.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <iterator>
#include <map>
#include <span>
#include <string_view>
#include <utility>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "antipode/image/load.h"
#include "antipode/render/enclosing_sphere.h"
#include "antipode/render/mesh_collection.h"
#include "antipode/render/mesh_encoding.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/formatted.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

using Bytes = std::vector<std::byte>;

constexpr char kIndexEntry[] = "antipode-meshes";
constexpr char kHowToMakeAPack[] = "give a folder of .glb files, or make the pack anew with antipode train pack";
constexpr std::uint32_t kVersion = 1;
constexpr int kTextureSides[] = {512, 384, 256, 192, 128, 96, 64, 32};
constexpr int kJpegQuality = 85;

std::string MeshEntry(std::size_t number) { return "mesh " + std::to_string(number); }
std::string TextureEntry(std::size_t number) { return "texture " + std::to_string(number); }

cv::Mat Reduced(const cv::Mat& texture, int side) {
  const int longest = std::max(texture.rows, texture.cols);
  if (longest <= side) return texture;
  const auto shorter = [&](int length) { return std::max(1, (length * side + longest / 2) / longest); };
  cv::Mat reduced;
  cv::resize(texture, reduced, {shorter(texture.cols), shorter(texture.rows)}, 0, 0, cv::INTER_AREA);
  return reduced;
}

/// JPEG, or PNG, which loses nothing, where it is smaller: few and flat colours.
Bytes Compressed(const cv::Mat& rgb) {
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> jpeg, png;
  if (!cv::imencode(".jpg", bgr, jpeg, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality}) || !cv::imencode(".png", bgr, png))
    throw Error("texture", "cannot be encoded");
  const auto smaller = std::as_bytes(std::span(png.size() <= jpeg.size() ? png : jpeg));
  return {smaller.begin(), smaller.end()};
}

/// All textures, each once, in every size that may still fit.
class TextureSet {
 public:
  explicit TextureSet(std::size_t limit) : limit_(limit) {
    for (const int side : kTextureSides) encodings_[side];
  }

  std::uint32_t NumberOf(const cv::Mat& texture) {
    if (texture.empty()) return kNoTexture;
    const std::string look = Formatted("%d x %d ", texture.cols, texture.rows) + Sha256OfPicture(texture);
    const auto [place, is_new] = numbers_.emplace(look, static_cast<std::uint32_t>(numbers_.size()));
    if (is_new) Encode(texture);
    return place->second;
  }

  std::size_t size() const { return numbers_.size(); }
  /// From the largest side on; those that alone exceed the limit are gone.
  std::vector<int> Sides() const {
    std::vector<int> sides;
    for (const auto& [side, encoding] : encodings_) sides.push_back(side);
    return sides;
  }
  const std::vector<Bytes>& At(int side) const { return encodings_.at(side).textures; }
  std::size_t BytesAt(int side) const { return encodings_.at(side).bytes; }

 private:
  struct Encoding {
    std::vector<Bytes> textures;
    std::size_t bytes = 0;
  };

  void Encode(const cv::Mat& texture) {
    const int own_side = std::max(texture.rows, texture.cols);
    Bytes whole;
    for (auto place = encodings_.begin(); place != encodings_.end();) {
      auto& [side, encoding] = *place;
      if (side >= own_side && whole.empty()) whole = Compressed(texture);
      encoding.textures.push_back(side >= own_side ? whole : Compressed(Reduced(texture, side)));
      encoding.bytes += encoding.textures.back().size();
      place = encoding.bytes > limit_ ? encodings_.erase(place) : std::next(place);
    }
  }

  std::size_t limit_;
  std::map<std::string, std::uint32_t> numbers_;
  std::map<int, Encoding, std::greater<>> encodings_;
};

class PackWriter {
 public:
  explicit PackWriter(std::size_t limit) : limit_(limit), textures_(limit) {}

  void Add(const std::string& name, const Mesh& mesh) {
    std::vector<std::uint32_t> numbers;
    for (const Material& material : mesh.materials) numbers.push_back(textures_.NumberOf(material.texture));
    names_ += name + '\0';
    meshes_.push_back(EncodeMesh(mesh, numbers));
    ++result_.objects;
    result_.triangles += static_cast<std::int64_t>(mesh.triangles.size());
    result_.greatest_position_error = std::max(result_.greatest_position_error, PositionError(mesh, meshes_.back()));
  }

  MeshPackResult Write(const std::filesystem::path& file) {
    const std::size_t smallest = Archive({}).size();
    for (const int side : textures_.Sides()) {
      if (smallest + textures_.BytesAt(side) > limit_) continue;
      const std::string archive = Archive(textures_.At(side));
      if (archive.size() > limit_) continue;
      WriteFileAtomically(file, archive);
      result_.bytes = archive.size();
      result_.textures = static_cast<std::int64_t>(textures_.size());
      result_.texture_side = textures_.size() > 0 ? side : 0;
      return result_;
    }
    throw Error("pack", Formatted("of %lld objects does not fit into %.3g MiB, even with textures of %d pixels: the shapes take %.3g MiB",
                                  static_cast<long long>(result_.objects), static_cast<double>(limit_) / 0x1p20,
                                  *std::rbegin(kTextureSides), static_cast<double>(smallest) / 0x1p20),
                "raise --megabytes, or pack fewer objects");
  }

 private:
  static double PositionError(const Mesh& mesh, const Bytes& encoded) {
    const Mesh decoded = DecodeMesh(encoded, [](std::uint32_t) { return cv::Mat(); });
    double error = 0;
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
      error = std::max(error, (mesh.positions[i] - decoded.positions[i]).cast<double>().norm());
    const double radius = SmallestEnclosingSphere(mesh.positions).radius;
    return radius > 0 ? error / radius : 0;
  }

  std::string Archive(std::span<const Bytes> textures) const {
    const std::uint32_t numbers[] = {kVersion, static_cast<std::uint32_t>(textures_.size())};
    const std::string index = std::string(reinterpret_cast<const char*>(numbers), sizeof numbers) + names_;
    std::vector<ZipEntry> entries{{kIndexEntry, std::as_bytes(std::span(index)), ZipCompression::kDeflate}};
    for (std::size_t i = 0; i < meshes_.size(); ++i) entries.push_back({MeshEntry(i), meshes_[i], ZipCompression::kDeflate});
    for (std::size_t i = 0; i < textures.size(); ++i)
      entries.push_back({TextureEntry(i), textures[i], ZipCompression::kNone});
    return MakeZipArchive(entries);
  }

  std::size_t limit_;
  std::string names_;
  std::vector<Bytes> meshes_;
  TextureSet textures_;
  MeshPackResult result_;
};

ZipArchive OpenArchive(const std::filesystem::path& file) {
  const InputFile input(file);
  try {
    return ZipArchive(input);
  } catch (const BadFile&) {
    throw BadFile(file.string(), "is not a pack of meshes, or not all of it", kHowToMakeAPack);
  }
}

}  // namespace

void MeshPackOptions::Check() const {
  if (!(megabytes > 0 && megabytes <= 2000)) throw InvalidOption("megabytes", "must be more than 0 and at most 2000");
}

MeshPackResult PackMeshes(const MeshCollection& meshes, const std::filesystem::path& file, const MeshPackOptions& options,
                          const ProgressCallback& progress) {
  options.Check();
  PackWriter writer(static_cast<std::size_t>(options.megabytes * 0x1p20));
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (progress) progress({"packing meshes", static_cast<std::int64_t>(i), static_cast<std::int64_t>(meshes.size()), {}});
    writer.Add(meshes.Name(i), meshes.Load(i));
  }
  if (progress) progress({"writing the pack", 0, 0, {}});
  return writer.Write(file);
}

MeshPack::MeshPack(const std::filesystem::path& file) : subject_(file.string()), archive_(OpenArchive(file)) {
  if (!archive_.entries().contains(kIndexEntry)) throw BadFile(subject_, "is not a pack of meshes", kHowToMakeAPack);
  const Bytes index = archive_.Read(kIndexEntry);
  std::uint32_t numbers[2];
  if (index.size() <= sizeof numbers || index.back() != std::byte{0})
    throw BadFile(subject_, "has a damaged list of meshes", kHowToMakeAPack);
  std::memcpy(numbers, index.data(), sizeof numbers);
  if (numbers[0] != kVersion)
    throw BadFile(subject_, Formatted("is a pack of version %u, not %u", numbers[0], kVersion), kHowToMakeAPack);
  textures_ = numbers[1];
  const std::string_view text(reinterpret_cast<const char*>(index.data()), index.size());
  for (std::size_t start = sizeof numbers; start < text.size(); start += names_.back().size() + 1)
    names_.emplace_back(text.substr(start, text.find('\0', start) - start));
  if (archive_.entries().size() != 1 + names_.size() + std::uint64_t{textures_})
    throw BadFile(subject_, "lacks a mesh or texture, or has one too many", kHowToMakeAPack);
}

std::vector<std::byte> MeshPack::Read(const std::string& entry) const {
  const std::lock_guard lock(mutex_);
  return archive_.Read(entry);
}

cv::Mat MeshPack::LoadTexture(std::uint32_t number) const {
  const Bytes bytes = Read(TextureEntry(number));
  cv::Mat bgr, rgb;
  try {
    const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
    const std::vector encoded(data, data + bytes.size());
    if (!encoded.empty()) bgr = cv::imdecode(encoded, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    bgr.release();
  }
  if (bgr.empty()) throw BadFile(subject_, TextureEntry(number) + " cannot be decoded", kHowToMakeAPack);
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  return rgb;
}

Mesh MeshPack::Load(std::size_t index) const {
  std::map<std::uint32_t, cv::Mat> textures;  // materials of one mesh often share theirs
  const auto texture = [&](std::uint32_t number) {
    const auto [place, is_new] = textures.try_emplace(number);
    if (is_new) place->second = LoadTexture(number);
    return place->second;
  };
  const Bytes bytes = Read(MeshEntry(index));
  try {
    return DecodeMesh(bytes, texture);
  } catch (const BadFile&) {
    throw;
  } catch (const Error& error) {
    throw BadFile(subject_, Quoted(names_[index]) + " is damaged (" + error.what() + ")", kHowToMakeAPack);
  }
}

}  // namespace antipode
