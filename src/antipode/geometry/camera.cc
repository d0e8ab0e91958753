#include "antipode/geometry/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "antipode/util/error.h"

namespace antipode {
namespace {

void CheckFinite(const char* field, double value) {
  if (!std::isfinite(value)) {
    throw InvalidOption(field, "is not finite", "give a number in pixels");
  }
}

void CheckSize(const char* field, int pixels) {
  if (pixels > 0) return;
  throw InvalidOption(field, "is " + std::to_string(pixels),
                      "give a positive image size in pixels");
}

void CheckFocalLength(const char* field, double focal_length) {
  CheckFinite(field, focal_length);
  if (focal_length > 0) return;
  throw InvalidOption(field, "is " + std::to_string(focal_length),
                      "give a positive focal length in pixels");
}

void CheckPrincipalPoint(const char* field, double coordinate, int size) {
  CheckFinite(field, coordinate);
  if (coordinate >= -size && coordinate <= 2.0 * size) return;
  throw InvalidOption(field,
                      "is " + std::to_string(coordinate) + ", far outside an image of " +
                          std::to_string(size) + " pixels",
                      "give the principal point in pixels of this image");
}

}  // namespace

PinholeCamera PinholeCamera::FromFieldOfView(int width, int height, double field_of_view_deg) {
  if (!(field_of_view_deg > 0 && field_of_view_deg < 180)) {
    throw InvalidOption("fov", "is " + std::to_string(field_of_view_deg),
                        "give an angle between 0 and 180 degrees");
  }
  const double half_angle = field_of_view_deg * std::numbers::pi / 360.0;
  const double focal_length = 0.5 * std::max(width, height) / std::tan(half_angle);
  const PinholeCamera camera{width, height, focal_length, focal_length, 0.5 * width, 0.5 * height};
  camera.Check();
  return camera;
}

Eigen::Matrix3d PinholeCamera::Intrinsics() const {
  Eigen::Matrix3d intrinsics;
  intrinsics << fx, 0, cx, 0, fy, cy, 0, 0, 1;
  return intrinsics;
}

Eigen::Vector2d PinholeCamera::Project(const Eigen::Vector3d& point) const {
  return {fx * point.x() / point.z() + cx, fy * point.y() / point.z() + cy};
}

Eigen::Vector3d PinholeCamera::Ray(const Eigen::Vector2d& pixel) const {
  return {(pixel.x() - cx) / fx, (pixel.y() - cy) / fy, 1.0};
}

PinholeCamera PinholeCamera::Resized(int new_width, int new_height) const {
  const double scale_x = static_cast<double>(new_width) / width;
  const double scale_y = static_cast<double>(new_height) / height;
  return {new_width, new_height, fx * scale_x, fy * scale_y, cx * scale_x, cy * scale_y};
}

void PinholeCamera::Check() const {
  CheckSize("width", width);
  CheckSize("height", height);
  CheckFocalLength("fx", fx);
  CheckFocalLength("fy", fy);
  CheckPrincipalPoint("cx", cx, width);
  CheckPrincipalPoint("cy", cy, height);
}

}  // namespace antipode
