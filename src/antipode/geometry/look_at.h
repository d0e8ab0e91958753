#pragma once

#include <Eigen/Core>

#include "antipode/geometry/rigid3.h"

namespace antipode {

/// Where a camera stands on a sphere about the object's centre, which it looks at.
struct Viewpoint {
  double azimuth = 0;    ///< degrees; 0 on the object's +Z side, growing towards +X
  double elevation = 0;  ///< degrees above the horizon, -90..90
  double in_plane_rotation =
      0;                ///< degrees about the optical axis; positive turns the picture clockwise
  double distance = 1;  ///< from the object's centre, in object radii
};

/// Rotation of the camera at (azimuth a, elevation e), in-plane rotation g, in the object frame (+Y
/// up):
///   R = Rz(g) [ x right   = ( cos a,        0,     -sin a       )
///               y down    = ( sin e sin a, -cos e,  sin e cos a )
///               z forward = (-cos e sin a, -sin e, -cos e cos a ) ]
/// Built from the angles, so it is defined at the poles too.
Eigen::Matrix3d CameraRotationFromObject(const Viewpoint& viewpoint);

/// The pose with the camera centre at d (cos e sin a, sin e, cos e cos a) and the object's centre
/// on the optical axis: translation (0, 0, d).
Rigid3 CameraFromObject(const Viewpoint& viewpoint);

/// The viewpoint with this rotation and distance: elevation in -90..90, azimuth in [0, 360),
/// in-plane rotation in (-180, 180]. At a pole the azimuth is 0 and the in-plane rotation holds the
/// rest, so `CameraRotationFromObject` always gives the rotation back.
Viewpoint ViewpointFromRotation(const Eigen::Matrix3d& camera_from_object_rotation,
                                double distance = 1);

}  // namespace antipode
