#pragma once

#include <span>
#include <vector>

#include <opencv2/core.hpp>
#include <torch/torch.h>

namespace antipode {

/// Shrinks to width x height by Lanczos resampling (a = 3) on 8-bit channels, after averaging boxes of whole pixels
/// where more than half would be thrown away; bit for bit as the published programs do.
/// @param image 8UC3
cv::Mat ShrinkByLanczos(const cv::Mat& image, cv::Size size);

/// The picture as Zero123 was trained on: shrunk to fit `fit` x `fit` with its aspect ratio, never enlarged, and pasted in the middle
/// of a white square.
/// @param image 8UC3, object on white
cv::Mat PrepareReferencePicture(const cv::Mat& image, int fit = 220, int canvas = 256);

/// [1, 3, H, W], RGB in -1..1, of an 8UC3 RGB picture.
torch::Tensor PictureTensor(const cv::Mat& picture);

/// 8UC3 RGB pictures of [P, 3, H, W] in 0..1; truncated, not rounded, as the published program does.
std::vector<cv::Mat> PicturesOf(const torch::Tensor& images);

/// The box of the pixels that differ from white by more than 5 in some channel; its size is the last minus the first, as
/// the published program measures, so that the last row and column lie outside.
/// @throws Error if the picture is all white
cv::Rect BoxOfObject(const cv::Mat& picture);

/// The picture padded with white to a square of its diagonal, floor(sqrt(w^2 + h^2)), and turned counter-clockwise
/// about the centre by bicubic interpolation.
cv::Mat TurnedOnWhite(const cv::Mat& picture, double angle_deg);

/// In the middle of a white square; the odd pixel goes to the right and to the bottom.
cv::Mat PaddedToSquare(const cv::Mat& picture, int side);

}  // namespace antipode
