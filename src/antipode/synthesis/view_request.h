#pragma once

#include <span>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "antipode/geometry/camera.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/geometry/viewpoints.h"

namespace antipode {

/// One view to imagine.
struct ViewRequest {
  std::string name;              ///< decides the view's noise and its file's name: "e12.5_a-30.0"
  CanonicalDirection direction;  ///< azimuth 0 is the picture's own
  RelativeView relative;         ///< to the picture
};

/// The rotation from the picture's camera to the view's; the cameras of both stand upright.
Eigen::Matrix3d ViewFromPicture(const ViewRequest& request);

/// A view that was made. The frame of the object has +Y up; where the picture is known to look from, azimuth 0 is its own.
struct SynthesizedView {
  ViewRequest request;
  cv::Mat image;              ///< 8UC3, RGB, object on white
  PinholeCamera camera;       ///< principal point in the middle
  Rigid3 camera_from_object;  ///< unit: object radii
};

/// The paper's viewpoints (see PredefinedViewpoints).
/// @param reference_elevation_deg of the picture
/// @throws InvalidOption unless the elevation is between -90 and 90 degrees and `count` is positive
std::vector<ViewRequest> RequestPredefinedViews(int count, double reference_elevation_deg);

/// Every combination of elevations and azimuths, degrees.
std::vector<ViewRequest> RequestViews(std::span<const double> elevations_deg, std::span<const double> azimuths_deg,
                                      double reference_elevation_deg);

/// `count` viewpoints all around the object, on a golden-angle spiral: the sine of the elevation in equal steps.
std::vector<ViewRequest> RequestViewsAllAround(int count, double reference_elevation_deg);

/// Of Zero123's training views, in sides of the picture: a 35 mm lens before a 32 mm sensor.
inline constexpr double kTrainingFocalLength = 280.0 / 256;

/// The camera that a synthesiser imagines its pictures with: the same for all views, so that they agree on the size of
/// the object. (The published program gives every view a distance of its own, see published::ViewCameraOf.)
struct SynthesisCamera {
  double focal_length = 0;  ///< in sides of the square picture
  double distance = 0;      ///< object radii
};

/// The view as that camera sees it, the object's centre on the optical axis.
SynthesizedView PosedView(const ViewRequest& request, const cv::Mat& image, const SynthesisCamera& camera);

}  // namespace antipode
