#include "antipode/image/probe.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>

namespace antipode {
namespace {

using std::string_view_literals::operator""sv;

constexpr std::uint64_t kMaxTiffStrips = 1'000'000;

/// Unsigned integers at offsets; reads 0 beyond the end.
class Bytes {
 public:
  explicit Bytes(std::string_view bytes) : bytes_(bytes) {}

  std::uint64_t size() const { return bytes_.size(); }
  bool Has(std::uint64_t offset, std::uint64_t count) const {
    return offset <= size() && count <= size() - offset;
  }
  bool Matches(std::uint64_t offset, std::string_view text) const {
    return Has(offset, text.size()) && bytes_.substr(offset, text.size()) == text;
  }
  std::string_view Part(std::uint64_t offset, std::uint64_t count) const {
    return Has(offset, count) ? bytes_.substr(offset, count) : std::string_view();
  }
  std::uint64_t Big(std::uint64_t offset, int count) const {
    if (!Has(offset, count)) return 0;
    std::uint64_t value = 0;
    for (int i = 0; i < count; ++i) value = value << 8 | At(offset + i);
    return value;
  }
  std::uint64_t Little(std::uint64_t offset, int count) const {
    if (!Has(offset, count)) return 0;
    std::uint64_t value = 0;
    for (int i = count - 1; i >= 0; --i) value = value << 8 | At(offset + i);
    return value;
  }
  std::uint8_t At(std::uint64_t offset) const { return static_cast<std::uint8_t>(bytes_[offset]); }
  std::uint64_t Find(char byte, std::uint64_t from) const { return bytes_.find(byte, from); }

 private:
  std::string_view bytes_;
};

ImageProbe ProbePng(const Bytes& bytes) {
  ImageProbe probe{.format = ImageFormat::kPng};
  for (std::uint64_t at = 8; bytes.Has(at, 12);) {
    const std::uint64_t length = bytes.Big(at, 4);
    const std::uint64_t data = at + 8;
    if (!bytes.Has(data, length + 4)) break;
    if (bytes.Matches(at + 4, "IHDR")) {
      probe.width = bytes.Big(data, 4);
      probe.height = bytes.Big(data + 4, 4);
    } else if (bytes.Matches(at + 4, "acTL")) {
      probe.animated = bytes.Big(data, 4) > 1;
    } else if (bytes.Matches(at + 4, "eXIf")) {
      probe.exif = bytes.Part(data, length);
    } else if (bytes.Matches(at + 4, "IEND")) {
      probe.complete = true;
      break;
    }
    at = data + length + 4;
  }
  return probe;
}

bool StandsAlone(std::uint8_t jpeg_marker) {
  return jpeg_marker <= 0x01 || (jpeg_marker >= 0xD0 && jpeg_marker <= 0xD8) || jpeg_marker == 0xFF;
}

bool StartsJpegFrame(std::uint8_t marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

ImageProbe ProbeJpeg(const Bytes& bytes) {
  constexpr auto kExif = "Exif\0\0"sv;
  ImageProbe probe{.format = ImageFormat::kJpeg};
  std::uint64_t at = 2;
  while ((at = bytes.Find('\xFF', at)) != std::string_view::npos && bytes.Has(at, 2)) {
    const std::uint8_t marker = bytes.At(at + 1);
    if (StandsAlone(marker)) {
      at += marker == 0xFF ? 1 : 2;
      continue;
    }
    if (marker == 0xD9) {
      probe.complete = true;
      break;
    }
    const std::uint64_t length = bytes.Big(at + 2, 2);
    if (length < 2 || !bytes.Has(at + 2, length)) break;
    if (StartsJpegFrame(marker) && probe.width == 0) {
      probe.height = bytes.Big(at + 5, 2);
      probe.width = bytes.Big(at + 7, 2);
    } else if (marker == 0xE1 && probe.exif.empty() && bytes.Matches(at + 4, kExif)) {
      probe.exif = bytes.Part(at + 4 + kExif.size(), length - 2 - kExif.size());
    }
    at += 2 + length;
  }
  return probe;
}

void ReadWebpChunk(const Bytes& bytes, std::uint64_t at, ImageProbe& probe) {
  const std::uint64_t data = at + 8;
  if (bytes.Matches(at, "VP8X")) {
    probe.animated = (bytes.Little(data, 1) & 0x02) != 0;
    probe.width = bytes.Little(data + 4, 3) + 1;
    probe.height = bytes.Little(data + 7, 3) + 1;
  } else if (bytes.Matches(at, "EXIF")) {
    probe.exif = bytes.Part(data, bytes.Little(at + 4, 4));
    if (probe.exif.starts_with("Exif\0\0"sv)) probe.exif.remove_prefix(6);
  } else if (probe.width == 0 && bytes.Matches(at, "VP8 ") &&
             bytes.Matches(data + 3, "\x9d\x01\x2a")) {
    probe.width = bytes.Little(data + 6, 2) & 0x3FFF;
    probe.height = bytes.Little(data + 8, 2) & 0x3FFF;
  } else if (probe.width == 0 && bytes.Matches(at, "VP8L") && bytes.Matches(data, "\x2f") &&
             bytes.Has(data, 5)) {
    const std::uint64_t bits = bytes.Little(data + 1, 4);
    probe.width = (bits & 0x3FFF) + 1;
    probe.height = (bits >> 14 & 0x3FFF) + 1;
  }
}

ImageProbe ProbeWebp(const Bytes& bytes) {
  ImageProbe probe{.format = ImageFormat::kWebp};
  probe.complete = bytes.Has(8, bytes.Little(4, 4));
  for (std::uint64_t at = 12; bytes.Has(at, 8);) {
    ReadWebpChunk(bytes, at, probe);
    const std::uint64_t length = bytes.Little(at + 4, 4);
    at += 8 + length + length % 2;
  }
  return probe;
}

ImageProbe ProbeBmp(const Bytes& bytes) {
  ImageProbe probe{.format = ImageFormat::kBmp};
  const std::uint64_t pixels = bytes.Little(10, 4);
  const bool is_os2 = bytes.Little(14, 4) == 12;
  const auto magnitude = [](std::uint64_t bits) {
    return std::abs(static_cast<std::int64_t>(static_cast<std::int32_t>(bits)));
  };
  probe.width = is_os2 ? bytes.Little(18, 2) : magnitude(bytes.Little(18, 4));
  probe.height = is_os2 ? bytes.Little(20, 2) : magnitude(bytes.Little(22, 4));
  const std::uint64_t bits_per_pixel = bytes.Little(is_os2 ? 24 : 28, 2);
  const std::uint64_t compression = is_os2 ? 0 : bytes.Little(30, 4);
  const bool is_plain = compression == 0 || compression == 3;
  const std::uint64_t row_bytes = (probe.width * bits_per_pixel + 31) / 32 * 4;
  // Row and image sizes stay below 2^31 * 2^16 / 8 * 2^31, so the product needs the division here.
  const std::uint64_t available = bytes.size() > pixels ? bytes.size() - pixels : 0;
  probe.complete =
      is_plain ? row_bytes == 0 || available / row_bytes >= static_cast<std::uint64_t>(probe.height)
               : available > 0 && bytes.size() >= bytes.Little(2, 4);
  return probe;
}

/// The first directory of a TIFF or BigTIFF file.
class TiffDirectory {
 public:
  explicit TiffDirectory(const Bytes& bytes)
      : bytes_(bytes), little_(bytes.Matches(0, "II")), big_(Number(2, 2) == 43) {
    start_ = big_ ? Number(8, 8) : Number(4, 4);
    count_ = Number(start_, big_ ? 8 : 2);
  }

  struct Field {
    std::uint64_t tag = 0;
    std::uint64_t count = 0;
    std::uint64_t data = 0;
    int element_size = 1;
  };

  /// A field with no elements if there is none of this tag.
  Field Find(std::uint64_t tag) const {
    for (std::uint64_t i = 0; i < count_ && HasEntry(i); ++i) {
      const Field field = At(i);
      if (field.tag == tag) return field;
    }
    return {};
  }

  /// True if every entry, and what it points to, lies within the file.
  bool IsWhole() const {
    for (std::uint64_t i = 0; i < count_; ++i) {
      if (!HasEntry(i)) return false;
      const Field field = At(i);
      if (field.count > bytes_.size() ||
          !bytes_.Has(field.data, field.count * field.element_size)) {
        return false;
      }
    }
    return true;
  }

  std::uint64_t Element(const Field& field, std::uint64_t index) const {
    if (index >= field.count) return 0;
    return Number(field.data + index * field.element_size, field.element_size);
  }

 private:
  std::uint64_t EntrySize() const { return big_ ? 20 : 12; }
  std::uint64_t Entry(std::uint64_t index) const {
    return start_ + (big_ ? 8 : 2) + index * EntrySize();
  }
  bool HasEntry(std::uint64_t index) const { return bytes_.Has(Entry(index), EntrySize()); }

  Field At(std::uint64_t index) const {
    constexpr std::array<int, 19> kElementSizes = {1, 1, 1, 2, 4, 8, 1, 1, 2, 4,
                                                   8, 4, 8, 4, 1, 1, 8, 8, 8};
    const int word = big_ ? 8 : 4;
    const std::uint64_t entry = Entry(index);
    const std::uint64_t type = Number(entry + 2, 2);
    const int element_size = type < kElementSizes.size() ? kElementSizes[type] : 1;
    const std::uint64_t count = Number(entry + 4, word);
    const std::uint64_t value = entry + 4 + word;
    const bool is_inline = count <= static_cast<std::uint64_t>(word / element_size);
    return {Number(entry, 2), count, is_inline ? value : Number(value, word), element_size};
  }

  std::uint64_t Number(std::uint64_t offset, int size) const {
    return little_ ? bytes_.Little(offset, size) : bytes_.Big(offset, size);
  }

  Bytes bytes_;
  bool little_;
  bool big_;
  std::uint64_t start_ = 0;
  std::uint64_t count_ = 0;
};

bool HasAllStrips(const Bytes& bytes, const TiffDirectory& directory) {
  constexpr std::uint64_t kStripOffsets = 273, kStripSizes = 279, kTileOffsets = 324,
                          kTileSizes = 325;
  const bool tiled = directory.Find(kTileOffsets).count > 0;
  const TiffDirectory::Field offsets = directory.Find(tiled ? kTileOffsets : kStripOffsets);
  const TiffDirectory::Field sizes = directory.Find(tiled ? kTileSizes : kStripSizes);
  if (offsets.count == 0 || offsets.count > kMaxTiffStrips) return false;
  for (std::uint64_t i = 0; i < offsets.count; ++i) {
    if (!bytes.Has(directory.Element(offsets, i), directory.Element(sizes, i))) return false;
  }
  return true;
}

ImageProbe ProbeTiff(const Bytes& bytes) {
  constexpr std::uint64_t kWidth = 256, kHeight = 257;
  const TiffDirectory directory(bytes);
  ImageProbe probe{.format = ImageFormat::kTiff};
  probe.width = directory.Element(directory.Find(kWidth), 0);
  probe.height = directory.Element(directory.Find(kHeight), 0);
  probe.complete = directory.IsWhole() && HasAllStrips(bytes, directory);
  return probe;
}

std::uint64_t GifColourTableSize(std::uint64_t flags) {
  return (flags & 0x80) != 0 ? 3ull << ((flags & 7) + 1) : 0;
}

/// Offset behind a chain of length-prefixed blocks and its terminating zero.
std::uint64_t AfterGifBlocks(const Bytes& bytes, std::uint64_t at) {
  while (bytes.Has(at, 1) && bytes.At(at) != 0) at += 1 + bytes.At(at);
  return at + 1;
}

ImageProbe ProbeGif(const Bytes& bytes) {
  ImageProbe probe{.format = ImageFormat::kGif};
  probe.width = bytes.Little(6, 2);
  probe.height = bytes.Little(8, 2);
  int frames = 0;
  std::uint64_t at = 13 + GifColourTableSize(bytes.Little(10, 1));
  while (bytes.Has(at, 1) && !probe.complete) {
    const std::uint8_t introducer = bytes.At(at);
    if (introducer == 0x21) {
      at = AfterGifBlocks(bytes, at + 2);
    } else if (introducer == 0x2C) {
      ++frames;
      at = AfterGifBlocks(bytes, at + 11 + GifColourTableSize(bytes.Little(at + 9, 1)));
    } else {
      probe.complete = introducer == 0x3B;
      break;
    }
  }
  probe.animated = frames > 1;
  return probe;
}

/// The next decimal number, past white space and comments; moves `at` behind it.
std::int64_t NextPnmNumber(std::string_view text, std::size_t& at) {
  while (at < text.size() &&
         (std::isspace(static_cast<unsigned char>(text[at])) || text[at] == '#')) {
    at = text[at] == '#' ? std::min(text.find('\n', at), text.size()) : at + 1;
  }
  std::int64_t number = 0;
  for (; at < text.size() && text[at] >= '0' && text[at] <= '9' && number < 1'000'000'000; ++at) {
    number = 10 * number + (text[at] - '0');
  }
  return number;
}

ImageProbe ProbePnm(std::string_view text) {
  ImageProbe probe{.format = ImageFormat::kPnm};
  std::size_t at = 2;
  probe.width = NextPnmNumber(text, at);
  probe.height = NextPnmNumber(text, at);
  const std::int64_t largest = text[1] == '4' ? 1 : NextPnmNumber(text, at);
  if (text[1] < '4') {
    probe.complete = true;
    return probe;
  }
  const std::int64_t samples = text[1] == '6' ? 3 : 1;
  const std::int64_t row_bytes =
      text[1] == '4' ? (probe.width + 7) / 8 : probe.width * samples * (largest > 255 ? 2 : 1);
  const auto available = static_cast<std::int64_t>(text.size() - at) - 1;
  probe.complete = row_bytes > 0 && available / row_bytes >= probe.height;
  return probe;
}

bool IsHeif(const Bytes& bytes) {
  if (!bytes.Matches(4, "ftyp")) return false;
  constexpr std::string_view kBrands[] = {"heic", "heix", "heif", "mif1",
                                          "msf1", "hevc", "avif", "avis"};
  return std::ranges::any_of(kBrands,
                             [&](std::string_view brand) { return bytes.Matches(8, brand); });
}

bool IsPnm(const Bytes& bytes) {
  return bytes.Matches(0, "P") && bytes.Has(0, 3) && bytes.At(1) >= '1' && bytes.At(1) <= '6' &&
         std::isspace(bytes.At(2));
}

}  // namespace

ImageProbe ProbeImage(std::string_view text) {
  const Bytes bytes(text);
  if (bytes.Matches(0, "\x89PNG\r\n\x1a\n")) return ProbePng(bytes);
  if (bytes.Matches(0, "\xFF\xD8\xFF")) return ProbeJpeg(bytes);
  if (bytes.Matches(0, "RIFF") && bytes.Matches(8, "WEBP")) return ProbeWebp(bytes);
  if (bytes.Matches(0, "GIF87a") || bytes.Matches(0, "GIF89a")) return ProbeGif(bytes);
  if (bytes.Matches(0, "II*\0"sv) || bytes.Matches(0, "MM\0*"sv) || bytes.Matches(0, "II+\0"sv) ||
      bytes.Matches(0, "MM\0+"sv)) {
    return ProbeTiff(bytes);
  }
  if (bytes.Matches(0, "BM")) return ProbeBmp(bytes);
  if (IsPnm(bytes)) return ProbePnm(text);
  if (IsHeif(bytes)) return {.format = ImageFormat::kHeif, .complete = true};
  return {};
}

std::string_view Name(ImageFormat format) {
  switch (format) {
    case ImageFormat::kPng:
      return "PNG";
    case ImageFormat::kJpeg:
      return "JPEG";
    case ImageFormat::kWebp:
      return "WebP";
    case ImageFormat::kBmp:
      return "BMP";
    case ImageFormat::kTiff:
      return "TIFF";
    case ImageFormat::kGif:
      return "GIF";
    case ImageFormat::kPnm:
      return "PNM";
    case ImageFormat::kHeif:
      return "HEIF or AVIF";
    case ImageFormat::kUnknown:
      break;
  }
  return "unknown";
}

}  // namespace antipode
