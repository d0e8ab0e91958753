#include "antipode/nn/depthwise_gradient.h"

#include <algorithm>

#include "antipode/nn/float_pack.h"

namespace antipode {
namespace {

using antipode::Load, antipode::Store;

typedef std::uint32_t WordPack __attribute__((vector_size(4 * kLanes)));
typedef std::uint16_t HalfPack __attribute__((vector_size(2 * kLanes)));

ANTIPODE_INLINE void Load(const BFloat16Bits* from, FloatPack& pack) {
  HalfPack half;
  std::memcpy(&half, from, sizeof half);
  const WordPack words = __builtin_convertvector(half, WordPack) << 16;
  std::memcpy(&pack, &words, sizeof pack);
}

ANTIPODE_INLINE void Store(const FloatPack& pack, BFloat16Bits* to) {
  WordPack words;
  std::memcpy(&words, &pack, sizeof pack);
  words += 0x7fff + ((words >> 16) & 1);  // round to nearest even
  const HalfPack half = __builtin_convertvector(words >> 16, HalfPack);
  std::memcpy(to, &half, sizeof half);
}

template <int kKernel, typename T>
ANTIPODE_INLINE void InputGradient(const DepthwiseShape& s, const T* output_gradient,
                                   const float* weight, T* input_gradient, int first, int last) {
  for (int n = first; n < last; ++n) {
    const T* gradient = output_gradient + std::int64_t(n) * s.output_height * s.output_width * s.channels;
    T* result = input_gradient + std::int64_t(n) * s.input_height * s.input_width * s.channels;
    for (int y = 0; y < s.input_height; ++y) {
      for (int x = 0; x < s.input_width; ++x) {
        for (int c = 0; c < s.channels; c += kLanes) {
          FloatPack sum = {};
          for (int ky = 0; ky < kKernel; ++ky) {
            const int top = y + s.padding - ky;
            if (top < 0 || top % s.stride != 0 || top / s.stride >= s.output_height) continue;
            for (int kx = 0; kx < kKernel; ++kx) {
              const int left = x + s.padding - kx;
              if (left < 0 || left % s.stride != 0 || left / s.stride >= s.output_width) continue;
              FloatPack g, w;
              Load(gradient + (top / s.stride * s.output_width + left / s.stride) * s.channels + c, g);
              Load(weight + (ky * kKernel + kx) * s.channels + c, w);
              sum += g * w;
            }
          }
          Store(sum, result + (y * s.input_width + x) * s.channels + c);
        }
      }
    }
  }
}

template <int kKernel, typename T>
ANTIPODE_INLINE void WeightGradient(const DepthwiseShape& s, const T* input,
                                    const T* output_gradient, float* weight_gradient,
                                    float* bias_gradient, int first, int last) {
  for (int c = 0; c < s.channels; c += kLanes) {
    FloatPack sums[kKernel][kKernel] = {};
    FloatPack bias_sum = {};
    for (int n = first; n < last; ++n) {
      const T* gradient = output_gradient + std::int64_t(n) * s.output_height * s.output_width * s.channels + c;
      const T* image = input + std::int64_t(n) * s.input_height * s.input_width * s.channels + c;
      for (int y = 0; y < s.output_height; ++y) {
        const int top = y * s.stride - s.padding;
        for (int x = 0; x < s.output_width; ++x) {
          const int left = x * s.stride - s.padding;
          FloatPack g;
          Load(gradient + (y * s.output_width + x) * s.channels, g);
          bias_sum += g;
          const bool inside = top >= 0 && left >= 0 && top + kKernel <= s.input_height &&
                              left + kKernel <= s.input_width;
          const T* corner = image + (top * s.input_width + left) * s.channels;
          if (inside) {
#pragma GCC unroll 5
            for (int ky = 0; ky < kKernel; ++ky) {
#pragma GCC unroll 5
              for (int kx = 0; kx < kKernel; ++kx) {
                FloatPack v;
                Load(corner + (ky * s.input_width + kx) * s.channels, v);
                sums[ky][kx] += g * v;
              }
            }
            continue;
          }
#pragma GCC unroll 5
          for (int ky = 0; ky < kKernel; ++ky) {
            if (top + ky < 0 || top + ky >= s.input_height) continue;
#pragma GCC unroll 5
            for (int kx = 0; kx < kKernel; ++kx) {
              if (left + kx < 0 || left + kx >= s.input_width) continue;
              FloatPack v;
              Load(corner + (ky * s.input_width + kx) * s.channels, v);
              sums[ky][kx] += g * v;
            }
          }
        }
      }
    }
    const auto add = [c](const FloatPack& sum, float* to) {
      for (int lane = 0; lane < kLanes; ++lane) to[c + lane] += sum[lane];
    };
    add(bias_sum, bias_gradient);
    for (int tap = 0; tap < kKernel * kKernel; ++tap)
      add(sums[tap / kKernel][tap % kKernel], weight_gradient + tap * s.channels);
  }
}

ANTIPODE_EVERY_PROCESSOR void InputGradientOf(const DepthwiseShape& s, const float* g, const float* w,
                                              float* out, int first, int last) {
  s.kernel == 3 ? InputGradient<3>(s, g, w, out, first, last)
                : InputGradient<5>(s, g, w, out, first, last);
}

ANTIPODE_EVERY_PROCESSOR void InputGradientOf(const DepthwiseShape& s, const BFloat16Bits* g,
                                              const float* w, BFloat16Bits* out, int first, int last) {
  s.kernel == 3 ? InputGradient<3>(s, g, w, out, first, last)
                : InputGradient<5>(s, g, w, out, first, last);
}

ANTIPODE_EVERY_PROCESSOR void WeightGradientOf(const DepthwiseShape& s, const float* in, const float* g,
                                               float* weight, float* bias, int first, int last) {
  s.kernel == 3 ? WeightGradient<3>(s, in, g, weight, bias, first, last)
                : WeightGradient<5>(s, in, g, weight, bias, first, last);
}

ANTIPODE_EVERY_PROCESSOR void WeightGradientOf(const DepthwiseShape& s, const BFloat16Bits* in,
                                               const BFloat16Bits* g, float* weight, float* bias,
                                               int first, int last) {
  s.kernel == 3 ? WeightGradient<3>(s, in, g, weight, bias, first, last)
                : WeightGradient<5>(s, in, g, weight, bias, first, last);
}

}  // namespace

template <typename T>
void DepthwiseInputGradient(const DepthwiseShape& shape, const T* output_gradient,
                            const float* weight, T* input_gradient, int first_image,
                            int last_image) {
  InputGradientOf(shape, output_gradient, weight, input_gradient, first_image, last_image);
}

template <typename T>
void AddDepthwiseWeightGradient(const DepthwiseShape& shape, const T* input,
                                const T* output_gradient, float* weight_gradient,
                                float* bias_gradient, int first_image, int last_image) {
  WeightGradientOf(shape, input, output_gradient, weight_gradient, bias_gradient, first_image, last_image);
}

template void DepthwiseInputGradient(const DepthwiseShape&, const float*, const float*, float*, int, int);
template void DepthwiseInputGradient(const DepthwiseShape&, const BFloat16Bits*, const float*, BFloat16Bits*, int, int);
template void AddDepthwiseWeightGradient(const DepthwiseShape&, const float*, const float*, float*, float*, int, int);
template void AddDepthwiseWeightGradient(const DepthwiseShape&, const BFloat16Bits*, const BFloat16Bits*, float*, float*, int, int);

}  // namespace antipode
