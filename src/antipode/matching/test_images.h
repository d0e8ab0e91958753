#pragma once

#include <string>

#include <gtest/gtest.h>
#include <torch/torch.h>
#include <opencv2/imgproc.hpp>

#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/weights/safetensors.h"

namespace antipode {

/// Blocks of 4 x 4 pixels in random colours, as scripts/golden/matching.py makes them.
inline cv::Mat BlockImage(const std::string& name, int width, int height) {
  const auto blocks = ((SyntheticUniform(name, {(height + 3) / 4, (width + 3) / 4, 3}) + 1) * 128)
                          .to(torch::kUInt8);
  const cv::Mat small(static_cast<int>(blocks.size(0)), static_cast<int>(blocks.size(1)), CV_8UC3,
                      blocks.data_ptr());
  cv::Mat large;
  cv::resize(small, large, {}, 4, 4, cv::INTER_NEAREST);
  return large({0, 0, width, height}).clone();
}

/// What the Python package computed: a tensor of tests/data/matching/FILE.safetensors.
inline torch::Tensor Golden(const std::string& file, const std::string& tensor) {
  return ToTorch(SafetensorsReader("tests/data/matching/" + file + ".safetensors").Read(tensor));
}

inline void ExpectNear(const torch::Tensor& value, const torch::Tensor& expected, double tolerance = 1e-4) {
  ASSERT_EQ(value.sizes(), expected.sizes());
  EXPECT_LT(((value - expected).norm() / expected.norm()).item<double>(), tolerance);
}

}  // namespace antipode
