#pragma once

#include <optional>
#include <string_view>

namespace antipode {

/// What the pipeline needs of a picture's EXIF block.
struct ExifTags {
  int orientation = 1;  ///< 1 to 8; 1 is upright
  std::optional<double>
      focal_length_35mm;  ///< FocalLengthIn35mmFilm, millimetres; absent if 0 (unknown)
};

/// @param tiff the EXIF block from its TIFF header on; a damaged one gives defaults
ExifTags ReadExif(std::string_view tiff);

}  // namespace antipode
