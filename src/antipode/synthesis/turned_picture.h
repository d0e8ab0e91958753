#pragma once

#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "antipode/geometry/rigid3.h"

/// Pictures of an object turned in their plane (the paper's section 3.2): view synthesisers know upright objects.
namespace antipode {

/// A picture of an object on white, turned and cut to the box of the object.
struct TurnedPicture {
  cv::Mat object;  ///< 8UC3, the box without its last row and column
  cv::Mat padded;  ///< the same in the middle of a white square that fits all turns
};

/// `picture` (8UC3, on white) turned counter-clockwise by each angle, all to one scale.
/// @throws Error if the picture is all white
std::vector<TurnedPicture> TurnPictures(const cv::Mat& picture, std::span<const double> angles_deg);

/// The object's pose after its picture was turned counter-clockwise about the principal point.
Rigid3 TurnedPose(const Rigid3& camera_from_object, double angle_deg);

}  // namespace antipode
