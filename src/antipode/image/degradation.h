#pragma once

#include <cstdint>

#include <opencv2/core.hpp>

/// What lenses, sensors, files and segmentations do to pictures.
namespace antipode {

/// Each pixel becomes the mean along a line, as if the camera had turned during the exposure; beyond the border the picture is repeated.
/// @param picture 8 bits a channel, any number of them
/// @param length of the line, pixels
/// @param angle_deg of the line against the x axis
cv::Mat MotionBlurred(const cv::Mat& picture, double length, double angle_deg);

/// Independent normal noise on every channel of every pixel.
/// @param picture 8 bits a channel
/// @param deviation of 255
cv::Mat WithNoise(const cv::Mat& picture, double deviation, std::uint64_t seed);

/// What is left of a picture after it was a JPEG file (4:2:0; the published program of Zero123's poses keeps its views with quality 75).
/// @param picture 8UC3, RGB
cv::Mat AfterJpeg(const cv::Mat& picture, int quality = 75);

enum class PictureSide { kLeft, kTop, kRight, kBottom };

/// A mask of which the picture's border has cut off what lies on one side: as wide a strip of its box as `share` of the box.
/// @param mask 8UC1, > 125 is object
cv::Mat CutOff(const cv::Mat& mask, PictureSide side, double share);

}  // namespace antipode
