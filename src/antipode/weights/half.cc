#include "antipode/weights/half.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace antipode {
namespace {

/// The 16-bit format with `mantissa_bits` stored bits, the rest but the sign being the exponent.
std::uint16_t Narrow(double value, int mantissa_bits) {
  const int bias = (1 << (14 - mantissa_bits)) - 1;
  const std::uint32_t infinity = ((1u << (15 - mantissa_bits)) - 1) << mantissa_bits;
  const std::uint32_t sign = std::signbit(value) ? 0x8000u : 0u;
  if (std::isnan(value))
    return static_cast<std::uint16_t>(sign | infinity | 1u << (mantissa_bits - 1));
  if (std::isinf(value)) return static_cast<std::uint16_t>(sign | infinity);
  if (value == 0) return static_cast<std::uint16_t>(sign);
  // Below the smallest normal exponent the step between neighbours stays the same.
  const int exponent = std::max(std::ilogb(value), 1 - bias);
  const double steps = std::nearbyint(std::ldexp(std::abs(value), mantissa_bits - exponent));
  // A mantissa rounded up to the next power of two carries into the exponent by itself.
  const std::int64_t magnitude =
      (std::int64_t{exponent + bias - 1} << mantissa_bits) + static_cast<std::int64_t>(steps);
  return static_cast<std::uint16_t>(sign | std::min<std::int64_t>(magnitude, infinity));
}

}  // namespace

float FloatFromHalf(std::uint16_t bits) {
  const std::uint32_t sign = (bits & 0x8000u) << 16;
  const std::uint32_t exponent = bits >> 10 & 31;
  const std::uint32_t mantissa = bits & 0x3ffu;
  if (exponent == 31) return std::bit_cast<float>(sign | 0x7f800000u | mantissa << 13);
  if (exponent != 0) return std::bit_cast<float>(sign | (exponent + 112) << 23 | mantissa << 13);
  const float magnitude = static_cast<float>(mantissa) * 0x1p-24f;
  return sign ? -magnitude : magnitude;
}

float FloatFromBFloat16(std::uint16_t bits) {
  return std::bit_cast<float>(std::uint32_t{bits} << 16);
}

std::uint16_t HalfFromDouble(double value) { return Narrow(value, 10); }

std::uint16_t BFloat16FromDouble(double value) { return Narrow(value, 7); }

}  // namespace antipode
