#pragma once

#include <torch/torch.h>
#include <opencv2/core.hpp>

namespace antipode {

/// Whether a side is below 32 pixels, too few for the networks of this folder, or all pixels have
/// one colour.
/// @throws Error if `image` is not 8UC3
bool HasNothingToSee(const cv::Mat& image);

/// The image itself, or, if its longer side exceeds `max_side`, shrunk to that by averaging areas.
/// The shorter side keeps 32 pixels.
cv::Mat LimitSide(const cv::Mat& image, int max_side);

/// From pixel indices [N, 2] of what a network saw to pixels of the image, centres at integer +
/// 0.5.
torch::Tensor ToImagePixels(const torch::Tensor& pixels, cv::Size seen, cv::Size image);

}  // namespace antipode
