#include "antipode/matching/multi_scale_features.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include <ATen/Parallel.h>

#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr std::int64_t kRowsPerTask = 256;
constexpr int kMaxLevels = 4;

/// Calls `add(column, row, weight)` for the up to four pixels around a position, of a map of this
/// size.
template <typename Add>
void ForEachCorner(float x, float y, int width, int height, Add add) {
  if (!(x > -1 && y > -1 && x < static_cast<float>(width) && y < static_cast<float>(height)))
    return;
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
  const float right_weight = x - static_cast<float>(left),
              bottom_weight = y - static_cast<float>(top);
  for (int i = 0; i < 4; ++i) {
    const int column = left + i % 2, row = top + i / 2;
    const float weight =
        (i % 2 ? right_weight : 1 - right_weight) * (i / 2 ? bottom_weight : 1 - bottom_weight);
    if (weight > 0 && column >= 0 && row >= 0 && column < width && row < height)
      add(column, row, weight);
  }
}

torch::Tensor SampleWithGrid(const torch::Tensor& map, const torch::Tensor& positions) {
  const auto last = torch::tensor({map.size(1) - 1, map.size(0) - 1}, positions.options());
  const auto grid = (positions / last.clamp_min(1) * 2 - 1).view({1, -1, 1, 2});
  const auto channels_first = map.permute({2, 0, 1}).unsqueeze(0);
  return at::grid_sampler(channels_first, grid, 0, 0, true).squeeze(3).squeeze(0).t().contiguous();
}

/// Of a multiple of eight numbers; eight sums at a time let the compiler use vector instructions.
float SumOfSquares(const float* values, int count) {
  float sums[8] = {};
  for (int i = 0; i < count; i += 8)
    for (int j = 0; j < 8; ++j) sums[j] += values[i + j] * values[i + j];
  return std::accumulate(std::begin(sums), std::end(sums), 0.0f);
}

/// One row of `result` for each position, filled by `fill(x, y, row)`.
template <typename Fill>
void FillRows(const torch::Tensor& positions, torch::Tensor& result, Fill fill) {
  const auto host = positions.contiguous();
  const float* xy = host.const_data_ptr<float>();
  float* rows = result.data_ptr<float>();
  const std::int64_t stride = result.size(1);
  at::parallel_for(0, result.size(0), kRowsPerTask, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) fill(xy[2 * i], xy[2 * i + 1], rows + i * stride);
  });
}

}  // namespace

torch::Tensor SampleBilinear(const torch::Tensor& map, const torch::Tensor& positions) {
  if (!map.is_cpu()) return SampleWithGrid(map, positions);
  const auto source = map.contiguous();
  const float* pixels = source.const_data_ptr<float>();
  const auto height = static_cast<int>(map.size(0)), width = static_cast<int>(map.size(1));
  const std::int64_t channels = map.size(2);
  auto result = torch::zeros({positions.size(0), channels});
  FillRows(positions, result, [&](float x, float y, float* row) {
    ForEachCorner(x, y, width, height, [&](int column, int line, float weight) {
      const float* pixel = pixels + (static_cast<std::int64_t>(line) * width + column) * channels;
      for (std::int64_t c = 0; c < channels; ++c) row[c] += weight * pixel[c];
    });
  });
  return result;
}

MultiScaleFeatures::MultiScaleFeatures(const std::vector<torch::Tensor>& levels, cv::Rect visible)
    : visible_(visible) {
  if (levels.empty() || levels.size() > kMaxLevels)
    throw Error("features of several scales",
                "was given " + std::to_string(levels.size()) + " levels", "give 1 to 4");
  const std::int64_t height = levels.front().size(0), width = levels.front().size(1);
  for (const torch::Tensor& map : levels) {
    const auto host = map.to(torch::kCPU).contiguous();
    levels_.push_back({host, host.const_data_ptr<float>(),
                       MakeTaps(map.size(1), width, visible.x, visible.width),
                       MakeTaps(map.size(0), height, visible.y, visible.height)});
  }
}

std::vector<MultiScaleFeatures::Tap> MultiScaleFeatures::MakeTaps(std::int64_t coarse,
                                                                  std::int64_t fine, int begin,
                                                                  int count) {
  const float scale = fine > 1 ? static_cast<float>(coarse - 1) / static_cast<float>(fine - 1) : 0;
  std::vector<Tap> taps;
  for (int i = begin; i < begin + count; ++i) {
    const float position = scale * static_cast<float>(i);
    const int index = std::min(static_cast<int>(position), static_cast<int>(coarse) - 1);
    taps.push_back({index, index + 1 < coarse ? 1 : 0, position - static_cast<float>(index)});
  }
  return taps;
}

torch::Tensor MultiScaleFeatures::SampleBilinear(const torch::Tensor& positions) const {
  auto result =
      torch::zeros({positions.size(0), kChannels * static_cast<std::int64_t>(levels_.size())});
  FillRows(positions.to(torch::kCPU), result,
           [this](float x, float y, float* row) { AddSample(x, y, row); });
  return result.to(positions.device());
}

void MultiScaleFeatures::AddSample(float x, float y, float* sum) const {
  ForEachCorner(x, y, visible_.width, visible_.height, [&](int column, int row, float weight) {
    AddNormalized(column, row, weight, sum);
  });
}

void MultiScaleFeatures::AddNormalized(int column, int row, float weight, float* sum) const {
  constexpr float kSmallestLength = 1e-12f;
  float feature[kChannels * kMaxLevels];
  float* values = feature;
  for (const Level& level : levels_) {
    const Tap& x = level.columns[column];
    const Tap& y = level.rows[row];
    const std::int64_t width = level.map.size(1);
    const float* top = level.pixels + (y.index * width + x.index) * kChannels;
    const float* bottom = top + y.step * width * kChannels;
    const int step = x.step * kChannels;
    const float a = (1 - y.fraction) * (1 - x.fraction), b = (1 - y.fraction) * x.fraction;
    const float c = y.fraction * (1 - x.fraction), d = y.fraction * x.fraction;
    for (int i = 0; i < kChannels; ++i)
      values[i] = a * top[i] + b * top[i + step] + c * bottom[i] + d * bottom[i + step];
    values += kChannels;
  }
  const auto count = static_cast<int>(values - feature);
  const float factor = weight / std::max(std::sqrt(SumOfSquares(feature, count)), kSmallestLength);
  for (int i = 0; i < count; ++i) sum[i] += factor * feature[i];
}

}  // namespace antipode
