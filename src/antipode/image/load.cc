#include "antipode/image/load.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "antipode/image/exif.h"
#include "antipode/image/probe.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxFileBytes = 1u << 30;
constexpr int kJpegQuality = 95;
const double kFilmDiagonalMm = std::hypot(36, 24);

std::string SizeText(std::int64_t width, std::int64_t height) {
  return std::to_string(width) + " x " + std::to_string(height) + " pixels";
}

void CheckSize(const fs::path& path, std::int64_t width, std::int64_t height,
               const LoadImageOptions& options) {
  if (width < options.min_side || height < options.min_side) {
    throw BadFile(path.string(),
                  "has " + SizeText(width, height) + ", less than " +
                      std::to_string(options.min_side) + " on a side",
                  "give a larger picture");
  }
  if (width > options.max_pixels / height) {
    throw BadFile(path.string(),
                  "has " + SizeText(width, height) + ", more than " +
                      std::to_string(options.max_pixels) + " in all",
                  "reduce the picture first");
  }
}

[[noreturn]] void ThrowDamaged(const fs::path& path, ImageFormat format) {
  throw BadFile(path.string(), "is a truncated or damaged " + std::string(Name(format)) + " file",
                "get an intact copy");
}

void CheckProbe(const fs::path& path, const ImageProbe& probe, const LoadImageOptions& options) {
  if (probe.animated) {
    throw BadFile(path.string(), "is an animation", "save one of its frames as PNG or JPEG");
  }
  if (probe.format == ImageFormat::kGif || probe.format == ImageFormat::kHeif) {
    throw BadFile(path.string(),
                  "is a " + std::string(Name(probe.format)) + " file, which is not supported",
                  "convert it to PNG or JPEG");
  }
  if (probe.format == ImageFormat::kUnknown) return;
  if (probe.width <= 0 || probe.height <= 0) ThrowDamaged(path, probe.format);
  CheckSize(path, probe.width, probe.height, options);
  if (!probe.complete) ThrowDamaged(path, probe.format);
}

/// As stored: no turning upright, any depth and number of channels. Empty if it cannot be decoded.
cv::Mat Decode(const std::string& bytes) {
  const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8UC1,
                        const_cast<char*>(bytes.data()));
  try {
    return cv::imdecode(encoded, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    return {};
  }
}

cv::Mat To8Bit(const fs::path& path, const cv::Mat& decoded) {
  if (decoded.depth() == CV_8U) return decoded;
  if (decoded.depth() != CV_16U) {
    throw BadFile(path.string(), "has neither 8 nor 16 bits a channel",
                  "convert it to an 8-bit PNG");
  }
  cv::Mat reduced;
  decoded.convertTo(reduced, CV_8U, 255.0 / 65535.0);
  return reduced;
}

cv::Mat ToRgb(const cv::Mat& decoded) {
  cv::Mat rgb;
  switch (decoded.channels()) {
    case 1:
      cv::cvtColor(decoded, rgb, cv::COLOR_GRAY2RGB);
      break;
    case 3:
      cv::cvtColor(decoded, rgb, cv::COLOR_BGR2RGB);
      break;
    case 4:
      cv::cvtColor(decoded, rgb, cv::COLOR_BGRA2RGB);
      break;
    default:
      break;
  }
  return rgb;
}

/// Empty if every pixel is equally opaque: such a channel tells nothing.
cv::Mat VaryingAlpha(const cv::Mat& decoded) {
  if (decoded.channels() != 4) return {};
  cv::Mat alpha;
  cv::extractChannel(decoded, alpha, 3);
  double least = 0, most = 0;
  cv::minMaxLoc(alpha, &least, &most);
  return least < most ? alpha : cv::Mat();
}

cv::Mat Upright(const cv::Mat& stored, int exif_orientation) {
  if (stored.empty()) return stored;
  cv::Mat upright;
  switch (exif_orientation) {
    case 2:
      cv::flip(stored, upright, 1);
      break;
    case 3:
      cv::rotate(stored, upright, cv::ROTATE_180);
      break;
    case 4:
      cv::flip(stored, upright, 0);
      break;
    case 5:
      cv::transpose(stored, upright);
      break;
    case 6:
      cv::rotate(stored, upright, cv::ROTATE_90_CLOCKWISE);
      break;
    case 7:
      cv::transpose(stored, upright);
      cv::rotate(upright, upright, cv::ROTATE_180);
      break;
    case 8:
      cv::rotate(stored, upright, cv::ROTATE_90_COUNTERCLOCKWISE);
      break;
    default:
      return stored;
  }
  return upright;
}

std::string LowerCaseExtension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace

LoadedImage LoadImage(const fs::path& path, const LoadImageOptions& options) {
  const std::string bytes = ReadFile(path);
  if (bytes.empty()) throw BadFile(path.string(), "is empty", "give a picture");
  if (bytes.size() > kMaxFileBytes) {
    throw BadFile(path.string(), "is larger than 1 GiB", "reduce the picture first");
  }
  const ImageProbe probe = ProbeImage(bytes);
  CheckProbe(path, probe, options);

  const cv::Mat decoded = Decode(bytes);
  if (decoded.empty() && probe.format != ImageFormat::kUnknown) ThrowDamaged(path, probe.format);
  if (decoded.empty()) {
    throw BadFile(path.string(), "is not a picture of a known format", "give a PNG or JPEG file");
  }
  CheckSize(path, decoded.cols, decoded.rows, options);
  const cv::Mat shallow = To8Bit(path, decoded);
  const ExifTags exif = ReadExif(probe.exif);

  LoadedImage image;
  image.rgb = Upright(ToRgb(shallow), exif.orientation);
  if (image.rgb.empty()) {
    throw BadFile(path.string(), "has " + std::to_string(shallow.channels()) + " channels",
                  "convert it to an RGB or grey PNG");
  }
  image.alpha = Upright(VaryingAlpha(shallow), exif.orientation);
  if (exif.focal_length_35mm) {
    image.exif_focal_px =
        *exif.focal_length_35mm * std::hypot(image.rgb.cols, image.rgb.rows) / kFilmDiagonalMm;
  }
  return image;
}

void SaveImage(const fs::path& path, const cv::Mat& rgb) {
  if (rgb.empty() || (rgb.type() != CV_8UC3 && rgb.type() != CV_8UC1)) {
    throw Error(path.string(), "cannot hold this picture", "give 8-bit RGB or grey pixels");
  }
  const std::string extension = LowerCaseExtension(path);
  constexpr std::array<std::string_view, 3> kExtensions = {".png", ".jpg", ".jpeg"};
  if (std::ranges::find(kExtensions, extension) == kExtensions.end()) {
    throw Error(path.string(), "has no known picture extension", "use .png, .jpg or .jpeg");
  }
  cv::Mat bgr;
  if (rgb.channels() == 3) cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<uchar> encoded;
  cv::imencode(extension, bgr.empty() ? rgb : bgr, encoded,
               {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  WriteFileAtomically(
      path, std::string_view(reinterpret_cast<const char*>(encoded.data()), encoded.size()));
}

std::string Sha256OfPicture(const cv::Mat& picture) {
  const cv::Mat dense = picture.isContinuous() ? picture : picture.clone();
  return Sha256Hex({reinterpret_cast<const std::byte*>(dense.data), dense.total() * dense.elemSize()});
}

}  // namespace antipode
