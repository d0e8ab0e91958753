#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "antipode/geometry/rigid3.h"

/// The object-centric camera and the pose composition exactly as the published program computes
/// them, inexact where it is inexact. For fidelity checks and the paper's route; the product's own
/// route uses object/object_view.h. Pixel centres are at integers here.
namespace antipode::published {

/// First and last column and row of an object, inclusive.
struct InclusiveBox {
  double x0 = 0;
  double y0 = 0;
  double x1 = 0;
  double y1 = 0;
};

/// The square virtual camera that looks (almost) at the middle of a box.
struct LookAt {
  Eigen::Matrix3d virtual_from_camera;       ///< R_v = Rx(atan y) Ry(atan x); not an exact look-at
  Eigen::Matrix3d intrinsics;                ///< K_v
  Eigen::Matrix3d virtual_pixel_from_pixel;  ///< H = K_v R_v K^-1
  Eigen::Vector2d centre;                    ///< middle of the box in the source image
  Eigen::Vector2d centre_in_virtual;  ///< where H takes it; (size / 2, size / 2) were it exact
  double focal_length = 0;            ///< f_look = sqrt(f^2 + |centre - principal point|^2)
  int size = 0;                       ///< side in pixels, trunc of the margined box side
};

/// @param intrinsics K of the source image
/// @param margin free border on each side, as a fraction of the larger box side
/// @throws Error if the box has no extent
LookAt LookAtBox(const Eigen::Matrix3d& intrinsics, const InclusiveBox& box, double margin = 0.05);

/// Rotation that (almost) turns the ray (x, y, 1) onto the optical axis: Rx(atan y) Ry(atan x).
Eigen::Matrix3d LookAtRotation(double x, double y);

/// Box of the pixels of which any channel differs from 255 by more than `threshold`.
/// @param rgb height x width x 3, row-major
/// @throws Error if every pixel is background
InclusiveBox NonWhiteBox(std::span<const std::uint8_t> rgb, int width, int height,
                         int threshold = 5);

/// Camera and distance given to one generated view.
struct ViewCamera {
  InclusiveBox box;
  Eigen::Matrix3d intrinsics;  ///< focal length sqrt(width^2 + height^2), centred
  double distance = 0;         ///< so that the larger side of the silhouette spans two units
};

/// Box of the silhouette, K_g and d_i = 2 f_g / w (or h, where it is larger relative to the image).
ViewCamera ViewCameraOf(std::span<const std::uint8_t> rgb, int width, int height,
                        int threshold = 5);

/// An object pose in the virtual camera of a look-at, and the same pose in the camera itself.
struct ReferencePose {
  Rigid3 camera_from_object;
  double distance = 0;  ///< d_1 = 2 f_x / S, with f_x of the INPUT camera as in the program
};

/// Pose of the reference: R_v^T [Rz(g) R(e, 0) | (0, 0, d_1)].
/// @param elevation e, radians
/// @param upright_rotation g, radians: the counter-clockwise turn that made the virtual image
/// upright
ReferencePose ReferencePoseOf(const Eigen::Matrix3d& intrinsics, const LookAt& look_at,
                              double elevation, double upright_rotation);

/// Undoes the look-at: R_v^T applied to an object pose in the virtual camera.
Rigid3 CameraFromObject(const LookAt& look_at, const Rigid3& virtual_from_object);

/// R12 = R_2 R_1^T, t12 = t_2 - R12 t_1.
Rigid3 QueryFromReference(const Rigid3& query_from_object, const Rigid3& reference_from_object);

}  // namespace antipode::published
