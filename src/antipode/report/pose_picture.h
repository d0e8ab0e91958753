#pragma once

#include <opencv2/core.hpp>

#include "antipode/pose/two_view_pose.h"

namespace antipode {

/// A picture of the result (8UC3, RGB, white background) to be understood without reading.
///
/// Above: the reference and the query crop, cut from the photographs in full resolution. Both show
/// the frame of the object whose axes are, as the reference camera sees it, right (red), up (green)
/// and front (blue, towards the reference camera), and the front side of the cube around the object:
/// if the pose is right, they turn with the object. Beside them a globe with the places of both
/// cameras around the object, and the confidence as a bar. Below: the query once for each
/// hypothesis, with its axes and its probability.
cv::Mat DrawPosePicture(const TwoViewPose& pose, const ObjectPhotograph& reference,
                        const ObjectPhotograph& query);

}  // namespace antipode
