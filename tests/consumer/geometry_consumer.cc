#include <cmath>
#include <cstdio>

#include <antipode/geometry/look_at.h>
#include <antipode/geometry/rotation.h>

/// Two cameras a quarter of a turn apart: prints and checks their relative pose.
int main() {
  const antipode::Rigid3 reference_from_object =
      antipode::CameraFromObject({.azimuth = 10, .elevation = 0, .distance = 4});
  const antipode::Rigid3 query_from_object =
      antipode::CameraFromObject({.azimuth = 100, .elevation = 0, .distance = 4});
  const antipode::Rigid3 query_from_reference = query_from_object * reference_from_object.Inverse();
  const double angle = antipode::RotationAngleDeg(query_from_reference.rotation);
  std::printf("rotation %.6f degrees\n", angle);
  return std::abs(angle - 90) < 1e-9 ? 0 : 1;
}
