#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "antipode/geometry/camera.h"

/// Helpers to compose a visualisation. Canvases are 8UC3 RGB and are drawn into; colours are RGB,
/// 0..255; coordinates have pixel centres at integer + 0.5. Whatever lies outside the canvas is cut
/// off.
namespace antipode {

using Colour = cv::Scalar;

const Colour kWhite(255, 255, 255);
const Colour kBlack(0, 0, 0);
const Colour kGrey(160, 160, 160);
const Colour kRed(214, 39, 40);
const Colour kGreen(44, 160, 44);
const Colour kBlue(31, 119, 180);

struct LineStyle {
  Colour colour = kBlack;
  int thickness = 1;  ///< pixels
};

struct TextStyle {
  Colour colour = kBlack;
  double height = 12;  ///< of a capital letter, pixels
};

void DrawLine(cv::Mat& canvas, const cv::Point2d& from, const cv::Point2d& to,
              const LineStyle& style = {});

/// A line with a head at `to` and, behind it, `label` (may be empty) in the line's colour.
void DrawArrow(cv::Mat& canvas, const cv::Point2d& from, const cv::Point2d& to,
               const std::string& label, const LineStyle& style = {});

/// @param baseline_left left end of the text's base line
void DrawText(cv::Mat& canvas, const std::string& text, const cv::Point2d& baseline_left,
              const TextStyle& style = {});

/// Size of the text's box from the top of the capitals to the base line, pixels.
cv::Size2d MeasureText(const std::string& text, const TextStyle& style = {});

/// A disc mixed into the canvas: canvas + opacity (colour - canvas), opacity in 0..1.
void BlendDisc(cv::Mat& canvas, const cv::Point2d& centre, double radius, const Colour& colour,
               double opacity);

/// A horizontal bar whose filled share is `probability`, clamped to 0..1; NaN counts as 0.
void DrawProbabilityBar(cv::Mat& canvas, const cv::Rect& box, double probability,
                        const Colour& colour = kBlue);

/// Pictures (8UC3 or 8UC1) in a row, centred vertically, with `padding` pixels around each.
cv::Mat SideBySide(const std::vector<cv::Mat>& images, int padding = 8,
                   const Colour& background = kWhite);

/// An object frame on the optical axis of a camera.
struct AxesPose {
  Eigen::Matrix3d camera_from_object = Eigen::Matrix3d::Identity();
  double distance = 4;  ///< of the frame's origin from the camera
  double length = 1;    ///< of an axis, same unit
};

/// Projected axes, X red, Y green, Z blue, the farthest first. Nothing if a tip is behind the
/// camera.
void DrawAxes(cv::Mat& canvas, const PinholeCamera& camera, const AxesPose& pose);

/// A camera's direction as seen from the object.
struct ViewDot {
  Eigen::Vector3d direction;  ///< object frame, +Y up; any length but 0
  Colour colour = kRed;
  std::string label;
};

struct ViewSphere {
  cv::Point2d centre;
  double radius = 100;  ///< pixels
  double viewer_azimuth_deg =
      30;  ///< where the globe is looked at from, about +Y from +Z towards +X
  double viewer_elevation_deg = 25;  ///< above the horizon
  std::vector<ViewDot> dots;
};

/// A globe in parallel projection, meridians and parallels every 30 degrees, its far side paler,
/// with a dot for every direction; dots on the far side are paler and have no outline.
void DrawViewSphere(cv::Mat& canvas, const ViewSphere& sphere);

}  // namespace antipode
