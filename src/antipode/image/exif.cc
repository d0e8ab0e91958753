#include "antipode/image/exif.h"

#include <libexif/exif-data.h>

#include <memory>
#include <string>

namespace antipode {
namespace {

constexpr std::size_t kMaxBytes = 1 << 20;

std::optional<int> ShortTag(ExifData& data, ExifIfd directory, ExifTag tag) {
  const ExifEntry* const entry = exif_content_get_entry(data.ifd[directory], tag);
  if (entry == nullptr || entry->format != EXIF_FORMAT_SHORT || entry->size < 2)
    return std::nullopt;
  return exif_get_short(entry->data, exif_data_get_byte_order(&data));
}

}  // namespace

ExifTags ReadExif(std::string_view tiff) {
  ExifTags tags;
  if (tiff.empty() || tiff.size() > kMaxBytes) return tags;
  std::string block("Exif\0\0", 6);
  block += tiff;
  const std::unique_ptr<ExifData, decltype(&exif_data_unref)> data(
      exif_data_new_from_data(reinterpret_cast<const unsigned char*>(block.data()),
                              static_cast<unsigned>(block.size())),
      &exif_data_unref);
  if (!data) return tags;

  const int orientation = ShortTag(*data, EXIF_IFD_0, EXIF_TAG_ORIENTATION).value_or(1);
  if (orientation >= 1 && orientation <= 8) tags.orientation = orientation;
  const int focal_length =
      ShortTag(*data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM).value_or(0);
  if (focal_length > 0) tags.focal_length_35mm = focal_length;
  return tags;
}

}  // namespace antipode
