#include "antipode/image/exif.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "antipode/image/probe.h"
#include "antipode/util/files.h"

namespace antipode {
namespace {

std::string Block(const char* name) {
  const std::string bytes = ReadFile(std::filesystem::path(ANTIPODE_TEST_DATA) / name);
  return std::string(ProbeImage(bytes).exif);
}

TEST(ReadExif, ReadsOrientationAndFocalLength) {
  const ExifTags tags = ReadExif(Block("orientation_7.jpg"));
  EXPECT_EQ(tags.orientation, 7);
  EXPECT_EQ(tags.focal_length_35mm, 35);
  EXPECT_FALSE(ReadExif(Block("focal_length_unknown.jpg")).focal_length_35mm.has_value());
}

TEST(ReadExif, GivesDefaultsForNothingAndSurvivesDamage) {
  EXPECT_EQ(ReadExif("").orientation, 1);
  EXPECT_EQ(ReadExif("not exif at all").orientation, 1);
  const std::string intact = Block("orientation_7.jpg");
  std::mt19937 generator(1);
  for (int trial = 0; trial < 2000; ++trial) {
    std::string damaged = intact.substr(0, generator() % (intact.size() + 1));
    if (!damaged.empty()) damaged[generator() % damaged.size()] = static_cast<char>(generator());
    const ExifTags tags = ReadExif(damaged);
    EXPECT_GE(tags.orientation, 1);
    EXPECT_LE(tags.orientation, 8);
  }
}

}  // namespace
}  // namespace antipode
