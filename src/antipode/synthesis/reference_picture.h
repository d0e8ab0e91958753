#pragma once

#include <opencv2/core.hpp>

#include "antipode/geometry/camera.h"
#include "antipode/geometry/rigid3.h"

namespace antipode {

/// A photograph as view synthesisers take it: the object in the middle, upright, on white; and how to get back.
struct ReferencePicture {
  cv::Mat picture;                  ///< 8UC3, square, at the photograph's own resolution
  Eigen::Matrix3d crop_from_camera = Eigen::Matrix3d::Identity();
  double in_plane_rotation_deg = 0; ///< of the photograph; undone in `picture`
  double distance = 0;              ///< object radii: the larger side of the upright object spans two

  /// Pose of the photograph's camera in the object's frame (+Y up, azimuth 0 at the camera):
  /// R = R_v^T Rz(g) R(e, 0), t = R_v^T (0, 0, d).
  Rigid3 CameraFromObject(double elevation_deg) const;
};

/// @param image 8UC3, RGB
/// @param mask 8UC1, > 125 is object
/// @param in_plane_rotation_deg of the camera; positive turned the photograph clockwise
ReferencePicture MakeReferencePicture(const cv::Mat& image, const cv::Mat& mask, const PinholeCamera& camera,
                                      double in_plane_rotation_deg = 0);

}  // namespace antipode
