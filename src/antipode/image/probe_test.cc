#include "antipode/image/probe.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "antipode/util/files.h"

namespace antipode {
namespace {

const std::filesystem::path kData = ANTIPODE_TEST_DATA;

std::string Encoded(const std::string& extension, int width, int height) {
  std::vector<uchar> bytes;
  cv::imencode(extension, cv::Mat(height, width, CV_8UC3, cv::Scalar(1, 2, 3)), bytes);
  return {bytes.begin(), bytes.end()};
}

TEST(ProbeImage, KnowsFormatAndSizeOfWhatOpenCvWrites) {
  const std::pair<const char*, ImageFormat> formats[] = {
      {".png", ImageFormat::kPng}, {".jpg", ImageFormat::kJpeg},  {".webp", ImageFormat::kWebp},
      {".bmp", ImageFormat::kBmp}, {".tiff", ImageFormat::kTiff}, {".ppm", ImageFormat::kPnm}};
  for (const auto& [extension, format] : formats) {
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(313, 17), cv::Size(40, 1025)}) {
      const std::string bytes = Encoded(extension, size.width, size.height);
      const ImageProbe probe = ProbeImage(bytes);
      EXPECT_EQ(probe.format, format) << extension;
      EXPECT_EQ(probe.width, size.width) << extension;
      EXPECT_EQ(probe.height, size.height) << extension;
      EXPECT_TRUE(probe.complete) << extension;
      EXPECT_FALSE(probe.animated) << extension;
      EXPECT_FALSE(ProbeImage(bytes.substr(0, bytes.size() * 3 / 4)).complete) << extension;
    }
  }
}

TEST(ProbeImage, TellsAnimationsFromStills) {
  for (const char* const name : {"animated.gif", "animated.png", "animated.webp", "still.gif"}) {
    const std::string bytes = ReadFile(kData / name);
    const ImageProbe probe = ProbeImage(bytes);
    EXPECT_EQ(probe.animated, std::string(name).starts_with("animated")) << name;
    EXPECT_TRUE(probe.complete) << name;
    EXPECT_EQ(probe.width, 24) << name;
    EXPECT_EQ(probe.height, 16) << name;
  }
}

TEST(ProbeImage, FindsTheExifBlock) {
  for (const char* const name : {"orientation_6.jpg", "orientation_6.png", "orientation_6.webp"}) {
    const std::string bytes = ReadFile(kData / name);
    const std::string_view exif = ProbeImage(bytes).exif;
    EXPECT_TRUE(exif.starts_with("II*") || exif.starts_with("MM")) << name;
  }
  EXPECT_TRUE(ProbeImage(Encoded(".jpg", 9, 9)).exif.empty());
}

TEST(ProbeImage, ReadsNoByteBeyondTheEndOfAnyPrefix) {
  for (const auto& entry : std::filesystem::directory_iterator(kData)) {
    const std::string bytes = ReadFile(entry.path());
    for (std::size_t length = 0; length < bytes.size(); ++length) {
      const std::vector<char> exact(bytes.begin(),
                                    bytes.begin() + static_cast<std::ptrdiff_t>(length));
      const ImageProbe probe = ProbeImage({exact.data(), exact.size()});
      EXPECT_FALSE(probe.complete && probe.format != ImageFormat::kUnknown &&
                   length + 1 < bytes.size())
          << entry.path() << " cut to " << length << " of " << bytes.size();
    }
  }
}

}  // namespace
}  // namespace antipode
