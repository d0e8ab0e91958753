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

/// A view that was made.
struct SynthesizedView {
  ViewRequest request;
  cv::Mat image;              ///< 8UC3, RGB, object on white
  PinholeCamera camera;       ///< f = sqrt(2) side, principal point in the middle
  Rigid3 camera_from_object;  ///< object frame with +Y up; unit: object radii
};

/// The paper's viewpoints (see PredefinedViewpoints).
/// @param reference_elevation_deg of the picture
/// @throws InvalidOption unless the elevation is between -90 and 90 degrees and `count` is positive
std::vector<ViewRequest> RequestPredefinedViews(int count, double reference_elevation_deg);

/// Every combination of elevations and azimuths, degrees.
std::vector<ViewRequest> RequestViews(std::span<const double> elevations_deg, std::span<const double> azimuths_deg,
                                      double reference_elevation_deg);

/// The camera of a synthesised picture. The distance is such that the larger side of the box of pixels that differ from
/// white by more than 5 in some channel spans two radii: 2 f / side (specification of the published program).
/// @throws Error if the picture is all white
SynthesizedView PosedView(const ViewRequest& request, const cv::Mat& image);

}  // namespace antipode
