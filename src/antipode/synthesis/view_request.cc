#include "antipode/synthesis/view_request.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"
#include "antipode/zero123/picture.h"

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

SynthesizedView PosedView(const ViewRequest& request, const cv::Mat& image) {
  const double side = image.cols;
  const double focal_length = std::numbers::sqrt2 * side;
  const cv::Size extent = BoxOfObject(image).size();
  const double distance = 2 * focal_length / std::max(extent.width, extent.height);
  Rigid3 camera_from_object = CameraFromCanonical(request.direction, distance);
  camera_from_object.rotation = camera_from_object.rotation * CanonicalFromObjectRotation();
  return {request, image, {image.cols, image.rows, focal_length, focal_length, side / 2, image.rows / 2.0}, camera_from_object};
}

}  // namespace antipode
