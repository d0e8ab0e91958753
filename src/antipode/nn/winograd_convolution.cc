#include "antipode/nn/winograd_convolution.h"

#include <algorithm>
#include <numbers>

#include <ATen/Parallel.h>

#include "antipode/nn/float_pack.h"

namespace antipode {
namespace {

using torch::Tensor;

constexpr int kTile = 4;             // output pixels along a side
constexpr int kPatch = kTile + 2;    // input pixels, and products, along a side
constexpr int kProducts = kPatch * kPatch;
constexpr std::int64_t kPadding = 48;  // floats between planes, lest all fall into one set of the cache
constexpr std::int64_t kFewTiles = 256;
constexpr std::int64_t kTilesAtOnce = 128, kOutputsAtOnce = 64;

/// Numbers for each of the 36 products: row `r` of product `p` starts at data + p plane + r width.
struct Planes {
  Planes(std::int64_t most_rows, std::int64_t row_width) : width(row_width), plane(most_rows * row_width + kPadding),
                                                           storage(torch::empty({kProducts * plane}, torch::kFloat)) {}
  float* data() { return storage.data_ptr<float>(); }
  Tensor Matrices(std::int64_t rows) const { return storage.as_strided({kProducts, rows, width}, {plane, width, 1}); }

  std::int64_t width, plane;
  Tensor storage;
};

struct Map {
  std::int64_t height, width, channels;

  std::int64_t TilesAcross() const { return (width + kTile - 1) / kTile; }
  std::int64_t Tiles() const { return TilesAcross() * ((height + kTile - 1) / kTile); }
};

// Polynomials are evaluated at 0, +-kNear, +-kFar and infinity: half the rounding error of 0, +-1, +-2.
constexpr float kNear = std::numbers::sqrt2_v<float> / 2, kFar = std::numbers::sqrt2_v<float>;

ANTIPODE_INLINE void TransformInput(const FloatPack (&d)[kPatch], FloatPack (&out)[kPatch]) {
  const FloatPack even = d[4] - 2 * d[2], odd = kNear * (d[3] - 2 * d[1]);
  const FloatPack even2 = d[4] - 0.5f * d[2], odd2 = kFar * (d[3] - 0.5f * d[1]);
  out[0] = d[0] - 2.5f * d[2] + d[4];
  out[1] = even + odd;
  out[2] = even - odd;
  out[3] = even2 + odd2;
  out[4] = even2 - odd2;
  out[5] = d[1] - 2.5f * d[3] + d[5];
}

ANTIPODE_INLINE void TransformWeight(const FloatPack (&g)[3], FloatPack (&out)[kPatch]) {
  const FloatPack even = (g[0] + 0.5f * g[2]) * (-2.0f / 3), odd = g[1] * (-2 * kNear / 3);
  const FloatPack even2 = (g[0] + 2 * g[2]) * (1.0f / 6), odd2 = g[1] * (kFar / 6);
  out[0] = g[0];
  out[1] = even + odd;
  out[2] = even - odd;
  out[3] = even2 + odd2;
  out[4] = even2 - odd2;
  out[5] = g[2];
}

ANTIPODE_INLINE void TransformOutput(const FloatPack (&m)[kPatch], FloatPack (&out)[kTile]) {
  const FloatPack even = m[1] + m[2], odd = kNear * (m[1] - m[2]), even2 = m[3] + m[4], odd2 = kFar * (m[3] - m[4]);
  out[0] = m[0] + even + even2;
  out[1] = odd + odd2;
  out[2] = 0.5f * even + 2 * even2;
  out[3] = 0.5f * odd + 2 * odd2 + m[5];
}

/// Tiles first..last - 1 of all images; the planes start with tile `base`.
ANTIPODE_EVERY_PROCESSOR void TransformInputs(const float* x, Map map, std::int64_t first, std::int64_t last, std::int64_t base,
                                              std::int64_t plane, float* planes) {
  for (std::int64_t tile = first; tile < last; ++tile) {
    const std::int64_t place = tile % map.Tiles();
    const std::int64_t top = place / map.TilesAcross() * kTile - 1, left = place % map.TilesAcross() * kTile - 1;
    const float* const image = x + tile / map.Tiles() * map.height * map.width * map.channels;
    for (std::int64_t c = 0; c < map.channels; c += kLanes) {
      FloatPack columns[kPatch][kPatch];
      for (int j = 0; j < kPatch; ++j) {
        FloatPack pixels[kPatch], transformed[kPatch];
        for (int i = 0; i < kPatch; ++i) {
          const bool is_inside = left + j >= 0 && left + j < map.width && top + i >= 0 && top + i < map.height;
          if (is_inside) Load(image + ((top + i) * map.width + left + j) * map.channels + c, pixels[i]);
          else pixels[i] = FloatPack{};
        }
        TransformInput(pixels, transformed);
        for (int i = 0; i < kPatch; ++i) columns[i][j] = transformed[i];
      }
      for (int i = 0; i < kPatch; ++i) {
        FloatPack transformed[kPatch];
        TransformInput(columns[i], transformed);
        for (int j = 0; j < kPatch; ++j) Store(transformed[j], planes + (i * kPatch + j) * plane + (tile - base) * map.channels + c);
      }
    }
  }
}

/// Outputs first..last - 1; the planes start with output `base`.
ANTIPODE_EVERY_PROCESSOR void TransformWeights(const float* weight, std::int64_t channels, std::int64_t first, std::int64_t last,
                                               std::int64_t base, std::int64_t plane, float* planes) {
  for (std::int64_t output = first; output < last; ++output) {
    for (std::int64_t c = 0; c < channels; c += kLanes) {
      FloatPack columns[kPatch][3];
      for (int j = 0; j < 3; ++j) {
        FloatPack taps[3], transformed[kPatch];
        for (int i = 0; i < 3; ++i) Load(weight + (output * 9 + i * 3 + j) * channels + c, taps[i]);
        TransformWeight(taps, transformed);
        for (int i = 0; i < kPatch; ++i) columns[i][j] = transformed[i];
      }
      for (int i = 0; i < kPatch; ++i) {
        FloatPack transformed[kPatch];
        TransformWeight(columns[i], transformed);
        for (int j = 0; j < kPatch; ++j) Store(transformed[j], planes + (i * kPatch + j) * plane + (output - base) * channels + c);
      }
    }
  }
}

/// Channels from..from + count - 1 of tiles first..last - 1; the planes start with tile `base` and channel `from`.
ANTIPODE_EVERY_PROCESSOR void TransformOutputs(const float* planes, std::int64_t plane, const float* bias, Map map, std::int64_t from,
                                               std::int64_t count, std::int64_t first, std::int64_t last, std::int64_t base, float* y) {
  for (std::int64_t tile = first; tile < last; ++tile) {
    const std::int64_t place = tile % map.Tiles();
    const std::int64_t top = place / map.TilesAcross() * kTile, left = place % map.TilesAcross() * kTile;
    float* const image = y + tile / map.Tiles() * map.height * map.width * map.channels + from;
    for (std::int64_t c = 0; c < count; c += kLanes) {
      FloatPack columns[kTile][kPatch], shift;
      Load(bias + from + c, shift);
      for (int j = 0; j < kPatch; ++j) {
        FloatPack products[kPatch], transformed[kTile];
        for (int i = 0; i < kPatch; ++i) Load(planes + (i * kPatch + j) * plane + (tile - base) * count + c, products[i]);
        TransformOutput(products, transformed);
        for (int i = 0; i < kTile; ++i) columns[i][j] = transformed[i];
      }
      for (int i = 0; i < kTile && top + i < map.height; ++i) {
        FloatPack transformed[kTile];
        TransformOutput(columns[i], transformed);
        for (int j = 0; j < kTile && left + j < map.width; ++j)
          Store(transformed[j] + shift, image + ((top + i) * map.width + left + j) * map.channels + c);
      }
    }
  }
}

Map MapOf(const Tensor& x) { return {x.size(2), x.size(3), x.size(1)}; }

}  // namespace

bool WinogradIsFaster(const Tensor& x, const Tensor& weight) {
  constexpr std::int64_t kEnoughTiles = 48;  // below, transforming the weights takes longer than is won
  return !torch::GradMode::is_enabled() && x.device().is_cpu() && x.scalar_type() == torch::kFloat &&
         weight.scalar_type() == torch::kFloat && x.size(1) % kLanes == 0 && weight.size(0) % kLanes == 0 &&
         x.size(0) * MapOf(x).Tiles() >= kEnoughTiles && x.is_contiguous(at::MemoryFormat::ChannelsLast) &&
         weight.is_contiguous(at::MemoryFormat::ChannelsLast);
}

Tensor WinogradConvolution(const Tensor& x, const Tensor& weight, const Tensor& bias) {
  const Map input = MapOf(x), output{input.height, input.width, weight.size(0)};
  const std::int64_t tiles = x.size(0) * input.Tiles();
  // Whichever of tiles and weights is small is kept whole, so that each is transformed once.
  const std::int64_t tiles_at_once = tiles <= kFewTiles ? tiles : kTilesAtOnce;
  const std::int64_t outputs_at_once = tiles <= kFewTiles ? std::min(kOutputsAtOnce, output.channels) : output.channels;

  Tensor y = torch::empty({x.size(0), output.channels, output.height, output.width},
                          x.options().memory_format(at::MemoryFormat::ChannelsLast));
  const Tensor shift = bias.defined() ? bias : torch::zeros({output.channels}, x.options());
  Planes patches(tiles_at_once, input.channels), filters(outputs_at_once, input.channels);
  std::int64_t ready = -1;  // the first of the outputs whose filters are transformed
  for (std::int64_t tile = 0; tile < tiles; tile += tiles_at_once) {
    const std::int64_t tile_end = std::min(tiles, tile + tiles_at_once);
    at::parallel_for(tile, tile_end, 4, [&](std::int64_t first, std::int64_t last) {
      TransformInputs(x.const_data_ptr<float>(), input, first, last, tile, patches.plane, patches.data());
    });
    for (std::int64_t from = 0; from < output.channels; from += outputs_at_once) {
      const std::int64_t count = std::min(outputs_at_once, output.channels - from);
      if (ready != from) {
        at::parallel_for(from, from + count, 4, [&](std::int64_t first, std::int64_t last) {
          TransformWeights(weight.const_data_ptr<float>(), input.channels, first, last, from, filters.plane, filters.data());
        });
        ready = from;
      }
      Planes products(tile_end - tile, count);
      Tensor matrices = products.Matrices(tile_end - tile);
      at::bmm_out(matrices, patches.Matrices(tile_end - tile), filters.Matrices(count).transpose(1, 2));
      at::parallel_for(tile, tile_end, 4, [&](std::int64_t first, std::int64_t last) {
        TransformOutputs(products.data(), products.plane, shift.const_data_ptr<float>(), output, from, count, first, last, tile,
                         y.data_ptr<float>());
      });
    }
  }
  return y;
}

}  // namespace antipode
