#pragma once

#include <cstdint>

namespace antipode {

/// IEEE 754 binary16 and bfloat16, as bit patterns. Widening is exact; narrowing rounds to nearest,
/// ties to even, overflows to infinity, and turns every NaN into the quiet NaN of the same sign.
float FloatFromHalf(std::uint16_t bits);
float FloatFromBFloat16(std::uint16_t bits);
std::uint16_t HalfFromDouble(double value);
std::uint16_t BFloat16FromDouble(double value);

}  // namespace antipode
