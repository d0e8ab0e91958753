#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include <opencv2/core.hpp>

namespace antipode {

struct LoadImageOptions {
  std::int64_t max_pixels = 100'000'000;  ///< refuse larger pictures before decoding them
  int min_side = 8;                       ///< refuse pictures smaller than this, pixels
};

/// A picture as the pipeline wants it.
struct LoadedImage {
  cv::Mat rgb;    ///< 8UC3, RGB, turned upright by its EXIF orientation
  cv::Mat alpha;  ///< 8UC1 of the same size, or empty if the file has no (varying) alpha channel
  /// From FocalLengthIn35mmFilm: f = f35 * diagonal / 43.27 mm.
  std::optional<double> exif_focal_px;
};

/// Reads PNG, JPEG, WebP, TIFF, BMP and whatever else OpenCV decodes; 16 bit, grey and CMYK are
/// converted.
/// @throws BadFile naming the file and the way out: missing, directory, empty, truncated, not a
///   picture, too large (checked in the header, before decoding), too small, animated
LoadedImage LoadImage(const std::filesystem::path& path, const LoadImageOptions& options = {});

/// Writes a PNG or JPEG (by extension) atomically; `rgb` is 8UC3 RGB or 8UC1.
void SaveImage(const std::filesystem::path& path, const cv::Mat& rgb);

/// Hash of the pixels, row by row.
std::string Sha256OfPicture(const cv::Mat& picture);

}  // namespace antipode
