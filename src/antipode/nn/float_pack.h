#pragma once

#include <cstring>

/// Builds a function once for every instruction set; the loader picks the best one that the processor has.
#define ANTIPODE_EVERY_PROCESSOR __attribute__((target_clones("avx512f", "avx2", "default")))
/// What such a function calls, so that it is built with it.
#define ANTIPODE_INLINE inline __attribute__((always_inline))

namespace antipode {

/// Sixteen numbers: one register of AVX-512, two of AVX2. Packs travel by reference: passing them by value would depend
/// on the instruction set.
constexpr int kLanes = 16;
typedef float FloatPack __attribute__((vector_size(4 * kLanes)));

ANTIPODE_INLINE void Load(const float* from, FloatPack& pack) { std::memcpy(&pack, from, sizeof pack); }
ANTIPODE_INLINE void Store(const FloatPack& pack, float* to) { std::memcpy(to, &pack, sizeof pack); }

}  // namespace antipode
