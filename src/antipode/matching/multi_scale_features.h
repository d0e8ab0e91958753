#pragma once

#include <vector>

#include <torch/torch.h>
#include <opencv2/core.hpp>

namespace antipode {

/// Bilinear interpolation between pixels, zero outside the map.
/// @param map [H, W, C] float32
/// @param positions [M, 2] float32, column and row; pixel centres at integers
/// @return [M, C]
torch::Tensor SampleBilinear(const torch::Tensor& map, const torch::Tensor& positions);

/// A dense map of feature vectors of length 1, of which only what is asked for gets computed. The
/// vector of a pixel has the channels of all levels, interpolated bilinearly so that the corner
/// pixels of all levels lie on each other, divided by its length.
class MultiScaleFeatures {
 public:
  static constexpr int kChannels = 32;  ///< of each level

  /// @param levels [H, W, 32] float32 each, the finest, of H x W pixels, first
  /// @param visible the pixels of the finest level that the map consists of
  MultiScaleFeatures(const std::vector<torch::Tensor>& levels, cv::Rect visible);

  /// As the other `SampleBilinear`, from the map of visible pixels: [M, 32 levels].
  torch::Tensor SampleBilinear(const torch::Tensor& positions) const;

 private:
  struct Tap {
    int index = 0;       ///< of the first of the two pixels
    int step = 0;        ///< to the second one; 0 at the end
    float fraction = 0;  ///< weight of the second one
  };
  struct Level {
    torch::Tensor map;
    const float* pixels = nullptr;   ///< of `map`
    std::vector<Tap> columns, rows;  ///< for each visible column and row
  };

  static std::vector<Tap> MakeTaps(std::int64_t coarse, std::int64_t fine, int begin, int count);
  void AddNormalized(int column, int row, float weight, float* sum) const;
  void AddSample(float x, float y, float* sum) const;

  std::vector<Level> levels_;
  cv::Rect visible_;
};

}  // namespace antipode
