#include "antipode/weights/half.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace antipode {
namespace {

struct Format {
  float (*widen)(std::uint16_t);
  std::uint16_t (*narrow)(double);
  std::uint16_t infinity;
};

const Format kFormats[] = {{FloatFromHalf, HalfFromDouble, 0x7c00},
                           {FloatFromBFloat16, BFloat16FromDouble, 0x7f80}};

TEST(Half, KnownValues) {
  EXPECT_EQ(FloatFromHalf(0x3c00), 1.0f);
  EXPECT_EQ(FloatFromHalf(0xc000), -2.0f);
  EXPECT_EQ(FloatFromHalf(0x7bff), 65504.0f);
  EXPECT_EQ(FloatFromHalf(0x0001), 0x1p-24f);
  EXPECT_EQ(FloatFromHalf(0x03ff), 0x1p-14f - 0x1p-24f);
  EXPECT_EQ(HalfFromDouble(65519.99), 0x7bff);
  EXPECT_EQ(HalfFromDouble(65520), 0x7c00);
  EXPECT_EQ(HalfFromDouble(0x1p-25), 0x0000);
  EXPECT_EQ(HalfFromDouble(0x1.8p-24), 0x0002);
  EXPECT_EQ(FloatFromBFloat16(0x3f80), 1.0f);
  EXPECT_EQ(BFloat16FromDouble(1 + 0x1p-8), 0x3f80);
  EXPECT_EQ(BFloat16FromDouble(1 + 0x1.8p-7), 0x3f82);
  // Rounded once: by way of float this would become a tie.
  EXPECT_EQ(BFloat16FromDouble(1 + 0x1p-8 + 0x1p-40), 0x3f81);
}

TEST(Half, EveryPatternSurvivesTheRoundTrip) {
  for (const Format& format : kFormats) {
    for (int bits = 0; bits < 0x10000; ++bits) {
      const float value = format.widen(static_cast<std::uint16_t>(bits));
      const std::uint16_t back = format.narrow(value);
      const bool is_nan = (bits & 0x7fff) > format.infinity;
      EXPECT_EQ(std::isnan(value), is_nan);
      if (is_nan)
        EXPECT_TRUE(std::isnan(format.widen(back)));
      else
        EXPECT_EQ(back, bits);
    }
  }
}

TEST(Half, MidpointsRoundToEvenAndTheirSidesToTheNeighbours) {
  for (const Format& format : kFormats) {
    for (std::uint16_t bits = 0; bits + 1 < format.infinity; ++bits) {
      const auto above_bits = static_cast<std::uint16_t>(bits + 1);
      const double below = format.widen(bits);
      const double above = format.widen(above_bits);
      const double middle = (below + above) / 2;
      EXPECT_EQ(format.narrow(middle), bits % 2 == 0 ? bits : above_bits);
      EXPECT_EQ(format.narrow(std::nextafter(middle, 0.0)), bits);
      EXPECT_EQ(format.narrow(std::nextafter(middle, 1e300)), above_bits);
      EXPECT_EQ(format.narrow(-std::nextafter(middle, 0.0)), bits | 0x8000);
    }
  }
}

TEST(Half, OverflowIsInfinite) {
  for (const Format& format : kFormats) {
    const double largest = std::numeric_limits<double>::max();
    EXPECT_EQ(format.narrow(largest), format.infinity);
    EXPECT_EQ(format.narrow(-largest), format.infinity | 0x8000);
    EXPECT_EQ(format.narrow(std::numeric_limits<double>::denorm_min()), 0);
  }
}

}  // namespace
}  // namespace antipode
