#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace antipode {

/// The sRGB transfer function of IEC 61966-2-1, from 0..1 to 0..1.
inline float LinearFromSrgb(float encoded) {
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

/// Its inverse.
inline float SrgbFromLinear(float linear) {
  return linear <= 0.0031308f ? linear * 12.92f : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

/// Both functions by table, between bytes and linear light.
class SrgbTables {
 public:
  SrgbTables() {
    for (int i = 0; i < 256; ++i) linear_[i] = LinearFromSrgb(i / 255.f);
    for (int i = 0; i < kSteps; ++i) {
      encoded_[i] = static_cast<std::uint8_t>(255 * SrgbFromLinear(i / (kSteps - 1.f)) + 0.5f);
    }
  }

  float Linear(std::uint8_t encoded) const { return linear_[encoded]; }
  const std::array<float, 256>& linear() const { return linear_; }

  /// Nearest byte; values outside 0..1 are clamped.
  std::uint8_t Encoded(float linear) const {
    if (!(linear > 0)) return 0;
    if (linear >= 1) return 255;
    return encoded_[static_cast<int>(linear * (kSteps - 1) + 0.5f)];
  }

 private:
  // So fine that an error of half a step is a tenth of a level in the steep dark part.
  static constexpr int kSteps = 16384;
  std::array<float, 256> linear_;
  std::array<std::uint8_t, kSteps> encoded_;
};

}  // namespace antipode
