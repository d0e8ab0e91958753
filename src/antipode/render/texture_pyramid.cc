#include "antipode/render/texture_pyramid.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

namespace antipode {
namespace {

cv::Mat Encoded(const cv::Mat& linear, const SrgbTables& tables) {
  cv::Mat encoded(linear.size(), CV_8UC3);
  for (int i = 0; i < linear.rows; ++i) {
    const float* from = linear.ptr<float>(i);
    std::uint8_t* to = encoded.ptr<std::uint8_t>(i);
    for (int j = 0; j < 3 * linear.cols; ++j) to[j] = tables.Encoded(from[j]);
  }
  return encoded;
}

/// Where between two neighbouring texels a coordinate lies, on a row or column that repeats.
struct Neighbours {
  int first;
  int second;
  float weight;  // of the second
};

Neighbours NeighboursAt(float coordinate, int size) {
  const float position = (coordinate - std::floor(coordinate)) * static_cast<float>(size) + 0.5f;
  const int after = static_cast<int>(position);  // rounds down: position is positive
  const float weight = position - static_cast<float>(after);
  // A coordinate just under an integer may round to `size` texels.
  return {after == 0 ? size - 1 : std::min(after - 1, size - 1), after >= size ? 0 : after, weight};
}

}  // namespace

TexturePyramid::TexturePyramid(const cv::Mat& texture, const SrgbTables& tables)
    : tables_(&tables) {
  if (texture.empty()) return;
  levels_.push_back(texture);
  cv::Mat linear;
  const auto& table = tables.linear();
  cv::LUT(texture, cv::Mat(1, 256, CV_32FC1, const_cast<float*>(table.data())), linear);
  while (linear.total() > 1) {
    cv::Mat half;
    cv::resize(linear, half, {std::max(1, linear.cols / 2), std::max(1, linear.rows / 2)}, 0, 0,
               cv::INTER_AREA);
    levels_.push_back(Encoded(half, tables));
    linear = half;
  }
}

float TexturePyramid::TexelCount() const {
  return levels_.empty() ? 0.f : static_cast<float>(levels_[0].total());
}

const cv::Mat& TexturePyramid::LevelFor(float texel_area) const {
  if (!(texel_area > 2)) return levels_[0];
  // log2 of a texel's side, rounded to nearest: floor((log2(area) + 1) / 2).
  const int level = (std::ilogb(std::min(texel_area, 1e30f)) + 1) / 2;
  return levels_[std::min<std::size_t>(level, levels_.size() - 1)];
}

Eigen::Vector3f TexturePyramid::ColorAt(const Eigen::Vector2f& texcoord, float texel_area) const {
  if (levels_.empty()) return Eigen::Vector3f::Ones();
  const cv::Mat& level = LevelFor(texel_area);
  const Neighbours x = NeighboursAt(texcoord.x(), level.cols);
  const Neighbours y = NeighboursAt(texcoord.y(), level.rows);
  const auto* top = level.ptr<std::uint8_t>(y.first);
  const auto* bottom = level.ptr<std::uint8_t>(y.second);
  Eigen::Vector3f color;
  for (int c = 0; c < 3; ++c) {
    const float top_left = tables_->Linear(top[3 * x.first + c]);
    const float top_right = tables_->Linear(top[3 * x.second + c]);
    const float bottom_left = tables_->Linear(bottom[3 * x.first + c]);
    const float bottom_right = tables_->Linear(bottom[3 * x.second + c]);
    const float above = top_left + x.weight * (top_right - top_left);
    const float below = bottom_left + x.weight * (bottom_right - bottom_left);
    color[c] = above + y.weight * (below - above);
  }
  return color;
}

}  // namespace antipode
