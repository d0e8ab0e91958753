#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "antipode/image/load.h"

namespace antipode {

/// Which pixels belong to the object, and how that was found out.
struct ObjectMask {
  cv::Mat mask;                       ///< 8UC1, 0 or 255, one blob
  std::string source;                 ///< "file", "alpha", "box" or "background"
  std::vector<std::string> warnings;  ///< several blobs (largest kept), touches the border
};

struct MaskRequest {
  std::optional<std::filesystem::path> file;  ///< a mask picture of the same size, > 125 is object
  std::optional<cv::Rect> box;                ///< a box around the object, refined by GrabCut
};

/// The first that applies: mask file, box (GrabCut), alpha channel, uniform background.
/// @param image_name used in messages
/// @throws BadFile or Error if the mask file has another size, or the mask is empty or full, or
///   nothing tells the object from the background (the message says how to give a mask)
ObjectMask FindObjectMask(const LoadedImage& image, const MaskRequest& request,
                          const std::string& image_name);

/// Bounding box of the pixels over 125: [x, x + width] x [y, y + height], pixel edges at integers.
/// @throws Error if there is none
cv::Rect2d MaskBox(const cv::Mat& mask);

}  // namespace antipode
