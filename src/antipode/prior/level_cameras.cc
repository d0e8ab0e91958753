#include "antipode/prior/level_cameras.h"

#include <cmath>
#include <vector>

#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

constexpr double kLowestElevation = -10, kHighestElevation = 70;
constexpr int kElevations = 14, kAzimuths = 36;
constexpr double kSmoothingDeg = 12;
constexpr double kFloor = 1e-6;

std::vector<Eigen::Matrix3d> RotationsOfLevelPairs() {
  const auto elevation = [](int i) { return kLowestElevation + (kHighestElevation - kLowestElevation) * (i + 0.5) / kElevations; };
  std::vector<Eigen::Matrix3d> rotations;
  for (int reference = 0; reference < kElevations; ++reference) {
    const Eigen::Matrix3d object_from_reference = CameraRotationFromObject({.elevation = elevation(reference)}).transpose();
    for (int query = 0; query < kElevations; ++query)
      for (int azimuth = 0; azimuth < kAzimuths; ++azimuth)
        rotations.push_back(CameraRotationFromObject({.azimuth = 360.0 * azimuth / kAzimuths, .elevation = elevation(query)}) * object_from_reference);
  }
  return rotations;
}

}  // namespace

double LogDensityOfLevelCameras(const Eigen::Matrix3d& query_from_reference) {
  static const std::vector<Eigen::Matrix3d> pairs = RotationsOfLevelPairs();
  double sum = 0;
  for (const Eigen::Matrix3d& pair : pairs) {
    const double deviations = AngleBetweenDeg(query_from_reference, pair) / kSmoothingDeg;
    sum += std::exp(-0.5 * deviations * deviations);
  }
  return std::log(sum / static_cast<double>(pairs.size()) + kFloor);
}

}  // namespace antipode
