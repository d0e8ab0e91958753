#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "antipode/render/srgb.h"

namespace antipode {

/// A texture in sizes halved down to one texel, each averaged in linear light.
class TexturePyramid {
 public:
  /// @param texture 8UC3, RGB, sRGB; may be empty, then every colour is white
  TexturePyramid(const cv::Mat& texture, const SrgbTables& tables);

  bool empty() const { return levels_.empty(); }

  /// Texels of the largest level.
  float TexelCount() const;

  /// Linear RGB at `texcoord` ((0, 0) top left, wrapped around), bilinear between the texels of the
  /// level on which a texel is nearest in size to `texel_area` texels of the largest level.
  Eigen::Vector3f ColorAt(const Eigen::Vector2f& texcoord, float texel_area) const;

 private:
  const cv::Mat& LevelFor(float texel_area) const;

  const SrgbTables* tables_;
  std::vector<cv::Mat> levels_;
};

}  // namespace antipode
