#include "antipode/synthesis/view_request.h"

#include <cmath>
#include <numbers>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

void CheckElevation(double elevation_deg) {
  if (!(std::abs(elevation_deg) <= 90))
    throw InvalidOption("elevation", "is " + std::to_string(elevation_deg), "use -90 to 90 degrees");
}

std::string Rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

ViewRequest Request(const CanonicalDirection& direction, double reference_elevation_deg) {
  return {"e" + Rounded(DegreesFromRadians(direction.elevation)) + "_a" + Rounded(DegreesFromRadians(direction.azimuth)),
          direction, RelativeViewOf(direction, reference_elevation_deg)};
}

}  // namespace

std::vector<ViewRequest> RequestPredefinedViews(int count, double reference_elevation_deg) {
  CheckElevation(reference_elevation_deg);
  std::vector<ViewRequest> requests;
  for (const CanonicalDirection& direction : PredefinedViewpoints(count))
    requests.push_back(Request(direction, reference_elevation_deg));
  return requests;
}

std::vector<ViewRequest> RequestViews(std::span<const double> elevations_deg, std::span<const double> azimuths_deg,
                                      double reference_elevation_deg) {
  CheckElevation(reference_elevation_deg);
  std::vector<ViewRequest> requests;
  for (const double elevation : elevations_deg) {
    CheckElevation(elevation);
    for (const double azimuth : azimuths_deg)
      requests.push_back(Request({RadiansFromDegrees(elevation), RadiansFromDegrees(azimuth)}, reference_elevation_deg));
  }
  if (requests.empty()) throw InvalidOption("views", "are none", "ask for at least one");
  return requests;
}

std::vector<ViewRequest> RequestViewsAllAround(int count, double reference_elevation_deg) {
  CheckElevation(reference_elevation_deg);
  if (count < 1) throw InvalidOption("views", "is " + std::to_string(count), "use at least 1");
  std::vector<ViewRequest> requests;
  for (int i = 0; i < count; ++i) {
    const double turns = i / std::numbers::phi;
    requests.push_back(Request({std::asin(1 - (2 * i + 1.0) / count), 2 * std::numbers::pi * (turns - std::floor(turns))},
                               reference_elevation_deg));
  }
  return requests;
}

Eigen::Matrix3d ViewFromPicture(const ViewRequest& request) {
  const double picture_elevation = request.direction.elevation + RadiansFromDegrees(request.relative.polar);
  return CameraRotationFromCanonical(request.direction) * CameraRotationFromCanonical({picture_elevation, 0}).transpose();
}

SynthesizedView PosedView(const ViewRequest& request, const cv::Mat& image, const SynthesisCamera& camera) {
  const double focal_length = camera.focal_length * image.cols;
  Rigid3 camera_from_object = CameraFromCanonical(request.direction, camera.distance);
  camera_from_object.rotation = camera_from_object.rotation * CanonicalFromObjectRotation();
  return {request, image, {image.cols, image.rows, focal_length, focal_length, image.cols / 2.0, image.rows / 2.0}, camera_from_object};
}

}  // namespace antipode
