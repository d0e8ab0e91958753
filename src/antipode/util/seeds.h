#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <random>
#include <string_view>
#include <utility>
#include <vector>

namespace antipode {

/// 64-bit FNV-1a hash of a name: a seed that does not change between platforms and runs.
constexpr std::uint64_t HashOfName(std::string_view name) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  return hash;
}

/// A well mixed seed from two (the finaliser of SplitMix64).
constexpr std::uint64_t CombineSeeds(std::uint64_t a, std::uint64_t b) {
  std::uint64_t z = a + 0x9e3779b97f4a7c15ull * (b + 1);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

/// Uniform in [low, high); unlike the standard distributions, the same on every platform.
inline double UniformIn(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
}

/// Uniform in 0..count - 1, the same on every platform.
inline std::size_t UniformIndex(std::mt19937_64& random, std::size_t count) {
  return static_cast<std::size_t>(random() % count);
}

/// `count` different numbers below `limit` (fewer if there are not so many), in random order, the same on every platform.
template <typename Integer>
std::vector<Integer> DrawDistinct(Integer count, Integer limit, std::mt19937_64& random) {
  std::vector<Integer> numbers(static_cast<std::size_t>(limit));
  std::iota(numbers.begin(), numbers.end(), Integer{0});
  count = std::min(count, limit);
  for (Integer i = 0; i < count; ++i)
    std::swap(numbers[i], numbers[i + static_cast<Integer>(UniformIndex(random, static_cast<std::size_t>(limit - i)))]);
  numbers.resize(static_cast<std::size_t>(count));
  return numbers;
}

}  // namespace antipode
