#include "antipode/image/load.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "antipode/util/temporary_folder.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;
using std::string_literals::operator""s;

const fs::path kData = ANTIPODE_TEST_DATA;

std::string ReasonForRefusing(const fs::path& path, const LoadImageOptions& options = {}) {
  try {
    LoadImage(path, options);
  } catch (const BadFile& error) {
    EXPECT_TRUE(std::string(error.what()).starts_with(path.string() + ": ")) << error.what();
    return error.what();
  }
  return "";
}

void ExpectRefused(const fs::path& path, const std::string& reason) {
  EXPECT_NE(ReasonForRefusing(path).find(reason), std::string::npos)
      << path << ": " << ReasonForRefusing(path);
}

std::string Encoded(const std::string& extension, const cv::Mat& bgr) {
  std::vector<uchar> bytes;
  cv::imencode(extension, bgr, bytes);
  return {bytes.begin(), bytes.end()};
}

cv::Mat Noise(int type = CV_8UC3, int width = 40, int height = 30) {
  cv::Mat noise(height, width, type);
  cv::RNG(7).fill(noise, cv::RNG::UNIFORM, 0, noise.depth() == CV_16U ? 65536 : 256);
  return noise;
}

std::string BigEndian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xFF);
  return bytes;
}

std::string PngHeader(std::uint32_t width, std::uint32_t height) {
  return "\x89PNG\r\n\x1a\n"s + BigEndian(13) + "IHDR" + BigEndian(width) + BigEndian(height) +
         "\x08\x02\0\0\0"s + "\0\0\0\0"s + BigEndian(0) + "IEND\xAE\x42\x60\x82";
}

/// The scene of tests/data/image: grey, a red top left and a blue top right corner.
void ExpectUprightScene(const LoadedImage& image, double tolerance) {
  ASSERT_EQ(image.rgb.size(), cv::Size(24, 16));
  const auto expect_near = [&](int x, int y, const cv::Vec3b& colour) {
    EXPECT_LE(cv::norm(image.rgb.at<cv::Vec3b>(y, x), colour, cv::NORM_INF), tolerance)
        << x << ", " << y << ": " << image.rgb.at<cv::Vec3b>(y, x);
  };
  expect_near(3, 3, {255, 0, 0});
  expect_near(20, 3, {0, 0, 255});
  expect_near(3, 13, {128, 128, 128});
  expect_near(20, 13, {128, 128, 128});
}

TEST(LoadImage, TurnsEveryExifOrientationUprightExactlyOnce) {
  for (int orientation = 1; orientation <= 8; ++orientation) {
    SCOPED_TRACE(orientation);
    ExpectUprightScene(LoadImage(kData / ("orientation_" + std::to_string(orientation) + ".jpg")),
                       12);
  }
  ExpectUprightScene(LoadImage(kData / "orientation_6.png"), 0);
  ExpectUprightScene(LoadImage(kData / "orientation_6.webp"), 0);
}

TEST(LoadImage, KnowsTheFocalLengthFromExif) {
  for (const char* const name : {"orientation_1.jpg", "orientation_6.jpg", "orientation_6.png"}) {
    const LoadedImage image = LoadImage(kData / name);
    ASSERT_TRUE(image.exif_focal_px.has_value()) << name;
    EXPECT_NEAR(*image.exif_focal_px, 35 * std::hypot(24, 16) / 43.27, 0.01) << name;
  }
  EXPECT_FALSE(LoadImage(kData / "focal_length_unknown.jpg").exif_focal_px.has_value());
  EXPECT_FALSE(LoadImage(kData / "progressive.jpg").exif_focal_px.has_value());
}

TEST(LoadImage, ConvertsEveryKindOfPictureToRgb) {
  ExpectUprightScene(LoadImage(kData / "progressive.jpg"), 12);
  ExpectUprightScene(LoadImage(kData / "cmyk.jpg"), 12);
  ExpectUprightScene(LoadImage(kData / "palette.png"), 1);
  const LoadedImage grey = LoadImage(kData / "grey_alpha.png");
  EXPECT_EQ(grey.rgb.at<cv::Vec3b>(12, 12), cv::Vec3b(128, 128, 128));
  EXPECT_EQ(grey.alpha.at<uchar>(5, 11), 0);
  EXPECT_EQ(grey.alpha.at<uchar>(5, 12), 255);
}

TEST(LoadImage, ReadsLosslessFormatsExactlyWhateverTheirExtension) {
  const TemporaryFolder folder;
  const cv::Mat bgr = Noise();
  cv::Mat rgb;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  for (const std::string format : {".png", ".bmp", ".tiff", ".ppm"}) {
    const LoadedImage image = LoadImage(folder.Write("renamed.jpg", Encoded(format, bgr)));
    EXPECT_EQ(cv::norm(image.rgb, rgb, cv::NORM_INF), 0) << format;
    EXPECT_TRUE(image.alpha.empty()) << format;
  }
}

TEST(LoadImage, ScalesSixteenBitsToEight) {
  const TemporaryFolder folder;
  const cv::Mat bgr = Noise(CV_16UC3);
  cv::Mat rgb, expected;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  rgb.convertTo(expected, CV_8U, 1 / 257.0);
  for (const std::string format : {".png", ".tiff"}) {
    const LoadedImage image = LoadImage(folder.Write("deep" + format, Encoded(format, bgr)));
    EXPECT_EQ(image.rgb.type(), CV_8UC3);
    EXPECT_LE(cv::norm(image.rgb, expected, cv::NORM_INF), 1) << format;
  }
}

TEST(LoadImage, KeepsAlphaOnlyWhereItVaries) {
  const TemporaryFolder folder;
  cv::Mat bgra = Noise(CV_8UC4);
  cv::Mat alpha;
  cv::extractChannel(bgra, alpha, 3);
  const LoadedImage varying = LoadImage(folder.Write("a.png", Encoded(".png", bgra)));
  EXPECT_EQ(cv::norm(varying.alpha, alpha, cv::NORM_INF), 0);
  cv::insertChannel(cv::Mat(bgra.size(), CV_8UC1, cv::Scalar(255)), bgra, 3);
  EXPECT_TRUE(LoadImage(folder.Write("b.png", Encoded(".png", bgra))).alpha.empty());
}

TEST(LoadImage, RefusesWhatIsNoPicture) {
  const TemporaryFolder folder;
  ExpectRefused(folder.path() / "missing.png", "");
  EXPECT_NE(ReasonForRefusing(folder.path() / "missing.png"), "");
  EXPECT_NE(ReasonForRefusing(folder.path()), "");
  ExpectRefused(folder.Write("empty.png", ""), "is empty");
  ExpectRefused(folder.Write("text.png", "not a picture\n"), "not a picture of a known format");
  ExpectRefused(folder.Write("heic.jpg",
                             "\0\0\0\x18"
                             "ftypheic\0\0\0\0mif1heic"s),
                "HEIF");
}

TEST(LoadImage, RefusesAnimations) {
  ExpectRefused(kData / "animated.gif", "animation");
  ExpectRefused(kData / "animated.png", "animation");
  ExpectRefused(kData / "animated.webp", "animation");
  ExpectRefused(kData / "still.gif", "GIF");
}

TEST(LoadImage, ChecksTheSizeInTheHeaderBeforeDecoding) {
  const TemporaryFolder folder;
  ExpectRefused(folder.Write("huge.png", PngHeader(60000, 60000)),
                "60000 x 60000 pixels, more than");
  ExpectRefused(folder.Write("huge.ppm", "P6 60000 60000 255\n"),
                "60000 x 60000 pixels, more than");
  ExpectRefused(folder.Write("dot.png", Encoded(".png", Noise(CV_8UC3, 1, 1))), "less than 8");
  ExpectRefused(folder.Write("none.png", PngHeader(0, 10)), "damaged");
  const fs::path ordinary = folder.Write("ordinary.png", Encoded(".png", Noise()));
  EXPECT_EQ(ReasonForRefusing(ordinary, {.max_pixels = 1200}), "");
  EXPECT_NE(ReasonForRefusing(ordinary, {.max_pixels = 1199}), "");
  EXPECT_EQ(ReasonForRefusing(ordinary, {.min_side = 30}), "");
  EXPECT_NE(ReasonForRefusing(ordinary, {.min_side = 31}), "");
}

TEST(LoadImage, RefusesEveryTruncation) {
  const TemporaryFolder folder;
  std::vector<std::string> intact = {
      ReadFile(kData / "progressive.jpg"), ReadFile(kData / "cmyk.jpg"),
      ReadFile(kData / "orientation_6.webp"), ReadFile(kData / "orientation_6.jpg")};
  for (const std::string format : {".png", ".jpg", ".bmp", ".tiff", ".webp", ".ppm", ".pgm"}) {
    intact.push_back(Encoded(format, Noise(format == ".pgm" ? CV_8UC1 : CV_8UC3)));
  }
  for (const std::string& bytes : intact) {
    EXPECT_EQ(ReasonForRefusing(folder.Write("whole", bytes)), "");
    for (const double share : {0.05, 0.3, 0.5, 0.8, 0.95}) {
      const auto length = static_cast<std::size_t>(share * static_cast<double>(bytes.size()));
      EXPECT_NE(ReasonForRefusing(folder.Write("part", bytes.substr(0, length))), "")
          << bytes.substr(0, 4) << " of " << bytes.size() << " bytes cut to " << length;
    }
  }
}

TEST(LoadImage, AcceptsBytesBehindTheEndOfAJpeg) {
  const TemporaryFolder folder;
  const std::string bytes = ReadFile(kData / "orientation_3.jpg") + "\0\0trailing\xFF\xD8\xFF"s;
  ExpectUprightScene(LoadImage(folder.Write("trailing.jpg", bytes)), 12);
}

TEST(LoadImage, NeverFailsOtherwiseThanWithBadFileOnDamagedBytes) {
  const TemporaryFolder folder;
  std::mt19937 generator(3);
  std::vector<std::string> intact;
  for (const std::string format : {".png", ".jpg", ".bmp", ".tiff", ".webp", ".ppm"}) {
    intact.push_back(Encoded(format, Noise(CV_8UC3, 16, 12)));
  }
  for (const char* const name :
       {"orientation_6.jpg", "animated.gif", "animated.webp", "orientation_6.png"}) {
    intact.push_back(ReadFile(kData / name));
  }
  int accepted = 0, refused = 0;
  for (const std::string& bytes : intact) {
    for (int trial = 0; trial < 60; ++trial) {
      std::string damaged = bytes;
      for (int i = 0; i < 3; ++i) {
        damaged[generator() % std::min<std::size_t>(damaged.size(), 200)] =
            static_cast<char>(generator());
      }
      const bool is_refused =
          !ReasonForRefusing(folder.Write("damaged", damaged), {.max_pixels = 100'000}).empty();
      ++(is_refused ? refused : accepted);
    }
  }
  EXPECT_GT(refused, 100);
  EXPECT_GT(accepted, 10);
}

TEST(SaveImage, WritesWhatLoadImageReads) {
  const TemporaryFolder folder;
  const cv::Mat rgb = Noise();
  const cv::Mat before = rgb.clone();
  SaveImage(folder.path() / "a.PNG", rgb);
  EXPECT_EQ(cv::norm(LoadImage(folder.path() / "a.PNG").rgb, before, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(rgb, before, cv::NORM_INF), 0);

  const cv::Mat plain(30, 40, CV_8UC3, cv::Scalar(200, 100, 50));
  SaveImage(folder.path() / "a.jpg", plain);
  EXPECT_LE(cv::norm(LoadImage(folder.path() / "a.jpg").rgb, plain, cv::NORM_INF), 3);

  const cv::Mat grey = Noise(CV_8UC1);
  SaveImage(folder.path() / "grey.png", grey);
  cv::Mat as_rgb;
  cv::cvtColor(grey, as_rgb, cv::COLOR_GRAY2RGB);
  EXPECT_EQ(cv::norm(LoadImage(folder.path() / "grey.png").rgb, as_rgb, cv::NORM_INF), 0);
}

TEST(SaveImage, RefusesOtherFormatsAndLeavesNoFile) {
  const TemporaryFolder folder;
  EXPECT_THROW(SaveImage(folder.path() / "a.gif", Noise()), Error);
  EXPECT_THROW(SaveImage(folder.path() / "a", Noise()), Error);
  EXPECT_THROW(SaveImage(folder.path() / "a.png", cv::Mat()), Error);
  EXPECT_THROW(SaveImage(folder.path() / "a.png", Noise(CV_16UC3)), Error);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace antipode
