#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace antipode {

/// The largest 8-connected blob of pixels over 125.
struct LargestBlob {
  /// The input with every other blob set to 0; soft edges are kept. Shares the input's data if
  /// there was only one blob.
  cv::Mat mask;
  cv::Rect box;           ///< of the blob's pixels; empty if no pixel is over 125
  int blob_count = 0;     ///< blobs there were, before
  double area_share = 0;  ///< the blob's pixels / all pixels over 125
  bool fills_image = false;
};

/// @param mask 8UC1; never changed
LargestBlob FindLargestBlob(const cv::Mat& mask);

/// Several parts (others with at least 1 % of the pixels), touching the border of an image of this
/// size.
std::vector<std::string> BlobWarnings(const LargestBlob& blob, const cv::Size& image_size);

/// True if `box` reaches the first or last row or column of an image of this size.
bool TouchesBorder(const cv::Rect& box, const cv::Size& size);

}  // namespace antipode
