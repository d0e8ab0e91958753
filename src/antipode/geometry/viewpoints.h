#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "antipode/geometry/rigid3.h"

namespace antipode {

/// A direction from the object to the camera in the canonical frame of the paper: right-handed, Z
/// up.
struct CanonicalDirection {
  double elevation = 0;  ///< radians above the horizon
  double azimuth = 0;    ///< radians about +Z; 0 at +X, where the reference image sits
};

/// What a view synthesiser is asked for, relative to the reference view, in degrees.
struct RelativeView {
  double polar = 0;    ///< change of the polar angle; positive is a camera farther down
  double azimuth = 0;  ///< change of the azimuth, in [0, 360); positive is a camera to its right
  double radius = 0;   ///< change of the distance; always 0
};

/// The `count` predefined viewpoints on the upper hemisphere, on a golden-angle spiral: for
/// n = N .. 2N - 1, e = asin((n - N) / N), a = 2 pi n phi mod 2 pi with phi = (sqrt(5) - 1) / 2.
/// @throws InvalidOption if `count` is not positive
std::vector<CanonicalDirection> PredefinedViewpoints(int count);

/// Rotation of the camera looking at the origin from `direction`, canonical frame to camera:
///   x right   = (-sin a,        cos a,        0     )
///   y down    = ( sin e cos a,  sin e sin a, -cos e )
///   z forward = (-cos e cos a, -cos e sin a, -sin e )
Eigen::Matrix3d CameraRotationFromCanonical(const CanonicalDirection& direction);

/// The same camera at `distance` from the origin, which is on its optical axis.
Rigid3 CameraFromCanonical(const CanonicalDirection& direction, double distance);

/// The request for a viewpoint given the reference's elevation (degrees); its azimuth is 0.
RelativeView RelativeViewOf(const CanonicalDirection& direction, double reference_elevation_deg);

/// Change of axes from the product's object frame (+Y up) to the canonical frame (+Z up):
/// (x, y, z) -> (z, x, y). An elevation and an azimuth mean the same camera in both frames.
Eigen::Matrix3d CanonicalFromObjectRotation();

/// Farthest-point order as the refiner of the published system sees its views: starting from the
/// MEAN of all points, repeatedly the point farthest from those already taken (the first one on
/// ties). The mean takes one place, so points.size() - 1 indices come out and one point is lost.
std::vector<std::size_t> FarthestPointOrder(std::span<const Eigen::Vector3d> points);

}  // namespace antipode
