#include "antipode/geometry/object_centric_published.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include <Eigen/LU>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/viewpoints.h"
#include "antipode/util/error.h"

namespace antipode::published {
namespace {

Eigen::Matrix3d IntrinsicsOf(double focal_length, double centre_x, double centre_y) {
  Eigen::Matrix3d intrinsics;
  intrinsics << focal_length, 0, centre_x, 0, focal_length, centre_y, 0, 0, 1;
  return intrinsics;
}

bool DiffersFromWhite(const std::uint8_t* pixel, int threshold) {
  return std::any_of(pixel, pixel + 3, [&](int value) { return 255 - value > threshold; });
}

}  // namespace

Eigen::Matrix3d LookAtRotation(double x, double y) {
  return RotationAboutX(std::atan(y)) * RotationAboutY(-std::atan(x));
}

LookAt LookAtBox(const Eigen::Matrix3d& intrinsics, const InclusiveBox& box, double margin) {
  const double side = std::max(box.x1 - box.x0, box.y1 - box.y0) * (1.0 + 2.0 * margin);
  if (!(side >= 1.0)) throw Error("object box", "has no extent", "check the mask");
  const double focal_length = (intrinsics(0, 0) + intrinsics(1, 1)) / 2.0;

  LookAt look_at;
  look_at.centre = {(box.x0 + box.x1) / 2.0, (box.y0 + box.y1) / 2.0};
  look_at.size = static_cast<int>(side);
  const Eigen::Vector2d offset = look_at.centre - intrinsics.topRightCorner<2, 1>();
  look_at.virtual_from_camera =
      LookAtRotation(offset.x() / focal_length, offset.y() / focal_length);
  look_at.focal_length = std::sqrt(focal_length * focal_length + offset.squaredNorm());
  look_at.intrinsics = IntrinsicsOf(look_at.focal_length * look_at.size / side, look_at.size / 2.0,
                                    look_at.size / 2.0);
  look_at.virtual_pixel_from_pixel =
      look_at.intrinsics * look_at.virtual_from_camera * intrinsics.inverse();
  look_at.centre_in_virtual =
      (look_at.virtual_pixel_from_pixel * look_at.centre.homogeneous()).hnormalized();
  return look_at;
}

InclusiveBox NonWhiteBox(std::span<const std::uint8_t> rgb, int width, int height, int threshold) {
  int x0 = width, y0 = height, x1 = -1, y1 = -1;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (!DiffersFromWhite(rgb.data() + 3 * (std::size_t(y) * width + x), threshold)) continue;
      x0 = std::min(x0, x);
      x1 = std::max(x1, x);
      y0 = std::min(y0, y);
      y1 = std::max(y1, y);
    }
  }
  if (x1 < 0) throw Error("generated view", "is all white", "no object can be found in it");
  return {double(x0), double(y0), double(x1), double(y1)};
}

ViewCamera ViewCameraOf(std::span<const std::uint8_t> rgb, int width, int height, int threshold) {
  const InclusiveBox box = NonWhiteBox(rgb, width, height, threshold);
  const double focal_length = std::hypot(width, height);
  const double relative_width = (box.x1 - box.x0) / width;
  const double relative_height = (box.y1 - box.y0) / height;
  const double side = relative_width >= relative_height ? box.x1 - box.x0 : box.y1 - box.y0;
  return {box, IntrinsicsOf(focal_length, width / 2.0, height / 2.0), 2.0 * focal_length / side};
}

ReferencePose ReferencePoseOf(const Eigen::Matrix3d& intrinsics, const LookAt& look_at,
                              double elevation, double upright_rotation) {
  const double distance = 2.0 * intrinsics(0, 0) / look_at.size;
  const Rigid3 virtual_from_object{
      RotationAboutZ(upright_rotation) * CameraRotationFromCanonical({.elevation = elevation}),
      {0, 0, distance}};
  return {CameraFromObject(look_at, virtual_from_object), distance};
}

Rigid3 CameraFromObject(const LookAt& look_at, const Rigid3& virtual_from_object) {
  const Eigen::Matrix3d camera_from_virtual = look_at.virtual_from_camera.transpose();
  return {camera_from_virtual * virtual_from_object.rotation,
          camera_from_virtual * virtual_from_object.translation};
}

Rigid3 QueryFromReference(const Rigid3& query_from_object, const Rigid3& reference_from_object) {
  return query_from_object * reference_from_object.Inverse();
}

}  // namespace antipode::published
