#pragma once

#include <cstdint>

#include <torch/torch.h>
#include <opencv2/core.hpp>

namespace antipode {

/// Points of one image with a description of what is around each.
struct LocalFeatures {
  torch::Tensor
      keypoints;  ///< [N, 2] float32, x and y in pixels of the image, centres at integer + 0.5
  torch::Tensor descriptors;  ///< [N, D] float32
  torch::Tensor scores;       ///< [N] float32, higher is more repeatable
  cv::Size image_size;

  std::int64_t size() const { return keypoints.size(0); }

  static LocalFeatures None(int descriptor_size, cv::Size image_size) {
    return {torch::empty({0, 2}), torch::empty({0, descriptor_size}), torch::empty({0}),
            image_size};
  }
};

}  // namespace antipode
