#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "antipode/geometry/object_centric_published.h"
#include "numeric_tensor.h"

/// Between the tensors of a case and pictures (8UC3).
namespace antipode::golden {

enum class FirstAxis { kWith, kWithout };

/// Picture `index` of [N, H, W, 3], or the only one of [H, W, 3] for -1.
cv::Mat Picture(const NumericTensor& stored, std::int64_t index);

NumericTensor ChannelsLast(const std::vector<cv::Mat>& pictures, FirstAxis first);   // [N, H, W, 3] or [H, W, 3]
NumericTensor ChannelsFirst(const std::vector<cv::Mat>& pictures, FirstAxis first);  // [N, 3, H, W] or [3, H, W]

published::InclusiveBox NonWhiteBoxOf(const cv::Mat& picture);

/// Warp with exact bilinear weights; [size, size, 3].
NumericTensor ExactWarp(const cv::Mat& picture, const Eigen::Matrix3d& target_from_source, int size, double border);

}  // namespace antipode::golden
