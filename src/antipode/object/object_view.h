#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "antipode/geometry/camera.h"
#include "antipode/geometry/rigid3.h"

namespace antipode {

struct ObjectViewOptions {
  int size = 128;  ///< side of the square output, pixels
  /// Free border on each side, as a fraction of the mask's box (the paper's 5 %).
  double margin = 0.05;
  void Check() const;
};

/// The object-centric image of the paper (section 3.1): what a camera at the same place would see
/// if it looked exactly at the object, white outside the mask. Identical for reference and query.
struct ObjectView {
  cv::Mat image;         ///< size x size, 8UC3, RGB, white outside the mask
  cv::Mat mask;          ///< size x size, 8UC1, 0..255 coverage
  PinholeCamera camera;  ///< K_v of `image`
  Eigen::Matrix3d crop_from_camera = Eigen::Matrix3d::Identity();  ///< R_v: x_crop = R_v x_camera
  /// To the object's centre, in object radii: 2 / e (see LookAtBox) = f_v / half of the larger side
  /// of the mask's box in crop pixels, without margin; i.e. the object's larger side spans two
  /// radii (pinhole).
  double distance = 0;
  std::vector<std::string> warnings;  ///< e.g. the mask touches the border
};

/// A virtual square camera that looks at the centre of a box of pixels.
struct ObjectCrop {
  PinholeCamera camera;  ///< K_v
  /// R_v, a pure rotation; its z row is the ray through the box's centre.
  Eigen::Matrix3d crop_from_camera = Eigen::Matrix3d::Identity();
};

/// Exact look-at crop: R_v = Rx(beta) Ry(alpha) makes the ray (x, y, 1) through the box centre the
/// optical axis, alpha = atan(x), beta = atan2(y, sqrt(1 + x^2)); without roll: the crop's x axis
/// stays perpendicular to the camera's y axis. f_v is chosen so that the box with its margins fills
/// the square:
///   f_v = size / (e (1 + 2 margin)),
/// where e is the larger of the box's width and height, between the middles of its opposite edges,
/// at depth 1 of the rotated camera. `box` has pixel centres at integer + 0.5, i.e. it spans
/// [x, x + width] x [y, y + height].
/// @throws Error if the box spans so wide an angle that an edge is behind the rotated camera;
///   InvalidOption if the camera, the box or an option is impossible
ObjectCrop LookAtBox(const PinholeCamera& camera, const cv::Rect2d& box,
                     const ObjectViewOptions& options = {});

/// Homography H = K_v R_v K^-1 from source pixels to crop pixels.
Eigen::Matrix3d CropHomography(const PinholeCamera& camera, const ObjectCrop& crop);

/// The same homography for pixel centres at integers, as OpenCV's warps have them.
cv::Matx33d HomographyForOpenCv(const Eigen::Matrix3d& homography);

/// Crops `image` (8UC3, RGB) around the largest blob of `mask` (8UC1, same size; value > 125 is
/// object). Anti-aliased where it shrinks. Pixels farther than 2 px outside the blob's box count as
/// background.
/// @throws Error if the mask is empty, full or of another size, the camera is for another size, or
///   the crop would have to look behind the camera
ObjectView MakeObjectView(const cv::Mat& image, const cv::Mat& mask, const PinholeCamera& camera,
                          const ObjectViewOptions& options = {});

/// The pose between the photographs' cameras from that between their crop cameras, which stand at the same places:
///   R = R_v2^T R_crop R_v1,  t = R_v2^T t_crop
Rigid3 BetweenCameras(const ObjectView& reference, const ObjectView& query,
                      const Rigid3& query_crop_from_reference_crop);

/// Object pose in the crop camera has its centre on the optical axis at `distance`; hence the
/// translation of query_from_reference for a given rotation between the two *crop* cameras:
///   t = R_v2^T (d_2 e_z) - R (R_v1^T d_1 e_z),  R = R_v2^T R_crop R_v1  (paper, eq. for R12, t12)
Rigid3 ComposeFromCrops(const ObjectView& reference, const ObjectView& query,
                        const Eigen::Matrix3d& query_crop_from_reference_crop);

}  // namespace antipode
