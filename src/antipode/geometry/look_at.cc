#include "antipode/geometry/look_at.h"

#include <cmath>

#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

/// Azimuth in [0, 360) of a direction from the object to the camera; 0 at the poles.
double AzimuthDeg(const Eigen::Vector3d& to_camera) {
  if (to_camera.x() == 0.0 && to_camera.z() == 0.0) return 0.0;
  const double azimuth = DegreesFromRadians(std::atan2(to_camera.x(), to_camera.z()));
  const double positive = azimuth < 0.0 ? azimuth + 360.0 : azimuth;
  return positive < 360.0 ? positive : 0.0;
}

}  // namespace

Eigen::Matrix3d CameraRotationFromObject(const Viewpoint& viewpoint) {
  const double azimuth = RadiansFromDegrees(viewpoint.azimuth);
  const double elevation = RadiansFromDegrees(viewpoint.elevation);
  const double sin_a = std::sin(azimuth), cos_a = std::cos(azimuth);
  const double sin_e = std::sin(elevation), cos_e = std::cos(elevation);
  Eigen::Matrix3d upright;
  upright << cos_a, 0, -sin_a,               //
      sin_e * sin_a, -cos_e, sin_e * cos_a,  //
      -cos_e * sin_a, -sin_e, -cos_e * cos_a;
  return RotationAboutZ(RadiansFromDegrees(viewpoint.in_plane_rotation)) * upright;
}

Rigid3 CameraFromObject(const Viewpoint& viewpoint) {
  return {CameraRotationFromObject(viewpoint), {0, 0, viewpoint.distance}};
}

Viewpoint ViewpointFromRotation(const Eigen::Matrix3d& camera_from_object_rotation,
                                double distance) {
  const Eigen::Vector3d to_camera = -camera_from_object_rotation.row(2).transpose();
  Viewpoint viewpoint{.azimuth = AzimuthDeg(to_camera), .distance = distance};
  viewpoint.elevation =
      DegreesFromRadians(std::atan2(to_camera.y(), std::hypot(to_camera.x(), to_camera.z())));
  const Eigen::Matrix3d in_plane =
      camera_from_object_rotation * CameraRotationFromObject(viewpoint).transpose();
  viewpoint.in_plane_rotation = DegreesFromRadians(std::atan2(in_plane(1, 0), in_plane(0, 0)));
  return viewpoint;
}

}  // namespace antipode
