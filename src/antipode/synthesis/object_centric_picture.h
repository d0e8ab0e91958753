#pragma once

#include <opencv2/core.hpp>

namespace antipode {

inline constexpr double kObjectCentricMargin = 0.05;  ///< on every side, of the object's larger one; see ObjectViewOptions

/// The picture as the object prior and all that was trained beside it see it: the object's box in the middle of a square, its larger
/// side filling that but for the margin.
/// @param object_on_white 8UC3, see MakeReferencePicture
/// @param size of the square, pixels
cv::Mat ObjectCentricPicture(const cv::Mat& object_on_white, int size);

}  // namespace antipode
