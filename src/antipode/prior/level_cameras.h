#pragma once

#include <Eigen/Core>

namespace antipode {

/// What is known of how two cameras were held.
enum class CameraRoll {
  kAny,
  kLevel,  ///< the object stands upright and both horizons are horizontal
};

/// Log density, up to a constant, of the rotation between two level cameras that look at one object: elevations uniform
/// in -10..70 degrees, any azimuth between them; smoothed by a Gaussian of 12 degrees, with a floor of 1e-6 for rotations
/// that level cameras do not make.
double LogDensityOfLevelCameras(const Eigen::Matrix3d& query_from_reference);

}  // namespace antipode
