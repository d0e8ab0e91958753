#pragma once

#include <Eigen/Core>

namespace antipode {

/// A pinhole camera and the image size it belongs to.
///
/// Axes: x right, y down, z forward. Pixel centres are at integer + 0.5, so the image spans
/// [0, width] x [0, height] and the default principal point is (width / 2, height / 2).
/// Projection: u = fx x / z + cx, v = fy y / z + cy.
struct PinholeCamera {
  int width = 0;
  int height = 0;
  double fx = 0;
  double fy = 0;
  double cx = 0;
  double cy = 0;

  /// Square pixels, centred principal point; `field_of_view_deg` is across the longer side.
  static PinholeCamera FromFieldOfView(int width, int height, double field_of_view_deg);

  /// The 3x3 calibration matrix K.
  Eigen::Matrix3d Intrinsics() const;

  /// Pixel of a point in camera coordinates (z > 0).
  Eigen::Vector2d Project(const Eigen::Vector3d& point) const;

  /// Direction (x, y, 1) of the ray through a pixel.
  Eigen::Vector3d Ray(const Eigen::Vector2d& pixel) const;

  /// The same camera for an image resized to `new_width` x `new_height`.
  PinholeCamera Resized(int new_width, int new_height) const;

  /// @throws InvalidOption naming the field if a value is not finite, a focal length or size is not
  ///   positive, or the principal point is farther than one image size outside the image.
  void Check() const;
};

}  // namespace antipode
