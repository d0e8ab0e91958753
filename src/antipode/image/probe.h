#pragma once

#include <cstdint>
#include <string_view>

namespace antipode {

enum class ImageFormat { kUnknown, kPng, kJpeg, kWebp, kBmp, kTiff, kGif, kPnm, kHeif };

/// What the structure of an encoded picture tells without decoding it.
struct ImageProbe {
  ImageFormat format = ImageFormat::kUnknown;
  std::int64_t width = 0;   ///< 0 if the header ends before it
  std::int64_t height = 0;  ///< 0 if the header ends before it
  bool animated = false;    ///< more than one frame: GIF, APNG, WebP
  bool complete =
      false;  ///< the end mark or the declared length is there; true where neither exists
  /// EXIF block of a JPEG, PNG or WebP from its TIFF header on, else empty; points into the bytes.
  std::string_view exif = {};
};

/// Never fails: whatever cannot be understood stays at its default.
ImageProbe ProbeImage(std::string_view bytes);

/// "PNG", "JPEG", ...; "unknown" for kUnknown.
std::string_view Name(ImageFormat format);

}  // namespace antipode
