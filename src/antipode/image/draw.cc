#include "antipode/image/draw.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace antipode {
namespace {

constexpr int kSubpixelBits = 4;
constexpr double kSubpixels = 1 << kSubpixelBits;
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kArrowHead = 7;
constexpr double kFarOpacity = 0.35;
constexpr double kDegrees = std::numbers::pi / 180;
/// Keeps fixed-point coordinates in range; far outside any canvas.
constexpr double kFarAway = 1e6;

/// For drawing with `kSubpixelBits` and OpenCV's pixel centres at integers.
cv::Point Subpixel(const cv::Point2d& point) {
  const auto fixed = [](double value) {
    return cvRound((std::clamp(value, -kFarAway, kFarAway) - 0.5) * kSubpixels);
  };
  return {fixed(point.x), fixed(point.y)};
}

bool IsFinite(const cv::Point2d& point) { return std::isfinite(point.x) && std::isfinite(point.y); }

double FontScale(const TextStyle& style) {
  return cv::getFontScaleFromHeight(kFont, std::max(1, cvRound(style.height)));
}

int FontThickness(const TextStyle& style) { return std::max(1, cvRound(style.height / 12)); }

Colour Mixed(const Colour& colour, const Colour& with, double share) {
  return colour * (1 - share) + with * share;
}

/// Rows: right, up and towards the viewer, in the object frame.
Eigen::Matrix3d ViewerFromObject(const ViewSphere& sphere) {
  const double azimuth = sphere.viewer_azimuth_deg * kDegrees;
  const double elevation = sphere.viewer_elevation_deg * kDegrees;
  Eigen::Matrix3d rows;
  rows << std::cos(azimuth), 0, -std::sin(azimuth), -std::sin(elevation) * std::sin(azimuth),
      std::cos(elevation), -std::sin(elevation) * std::cos(azimuth),
      std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
      std::cos(elevation) * std::cos(azimuth);
  return rows;
}

Eigen::Vector3d OnGlobe(double azimuth, double elevation) {
  return {std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
          std::cos(elevation) * std::cos(azimuth)};
}

class Globe {
 public:
  Globe(cv::Mat& canvas, const ViewSphere& sphere)
      : canvas_(canvas), sphere_(sphere), viewer_from_object_(ViewerFromObject(sphere)) {}

  /// The near or the far half of the wireframe.
  void DrawWires(bool near_half) {
    constexpr int kStepDeg = 30, kSegmentDeg = 5;
    for (int circle = -60; circle <= 60; circle += kStepDeg) {
      for (int along = 0; along < 360; along += kSegmentDeg) {
        DrawSegment(OnGlobe(along * kDegrees, circle * kDegrees),
                    OnGlobe((along + kSegmentDeg) * kDegrees, circle * kDegrees), near_half);
      }
    }
    for (int circle = 0; circle < 180; circle += kStepDeg) {
      for (int along = 0; along < 360; along += kSegmentDeg) {
        DrawSegment(OnGlobe(circle * kDegrees, along * kDegrees),
                    OnGlobe(circle * kDegrees, (along + kSegmentDeg) * kDegrees), near_half);
      }
    }
  }

  void DrawDots(bool near_half) {
    for (const ViewDot& dot : sphere_.dots) {
      const Eigen::Vector3d seen = viewer_from_object_ * dot.direction.normalized();
      if (!seen.allFinite() || (seen.z() >= 0) != near_half) continue;
      const double radius = std::max(3.0, 0.05 * sphere_.radius);
      const cv::Point2d pixel = Pixel(seen);
      if (near_half) BlendDisc(canvas_, pixel, radius + 1.5, kWhite, 1);
      BlendDisc(canvas_, pixel, radius, dot.colour, near_half ? 1 : kFarOpacity);
      if (dot.label.empty()) continue;
      const TextStyle style{.colour = Mixed(dot.colour, kWhite, near_half ? 0 : 1 - kFarOpacity),
                            .height = std::max(8.0, 0.1 * sphere_.radius)};
      DrawText(canvas_, dot.label, pixel + cv::Point2d(radius + 3, 0.5 * style.height), style);
    }
  }

 private:
  cv::Point2d Pixel(const Eigen::Vector3d& seen) const {
    return sphere_.centre + sphere_.radius * cv::Point2d(seen.x(), -seen.y());
  }

  void DrawSegment(const Eigen::Vector3d& from, const Eigen::Vector3d& to, bool near_half) {
    const Eigen::Vector3d seen_from = viewer_from_object_ * from,
                          seen_to = viewer_from_object_ * to;
    if ((seen_from.z() + seen_to.z() >= 0) != near_half) return;
    const Colour colour = near_half ? kGrey : Mixed(kGrey, kWhite, 0.6);
    DrawLine(canvas_, Pixel(seen_from), Pixel(seen_to), {.colour = colour});
  }

  cv::Mat& canvas_;
  const ViewSphere& sphere_;
  Eigen::Matrix3d viewer_from_object_;
};

}  // namespace

void DrawLine(cv::Mat& canvas, const cv::Point2d& from, const cv::Point2d& to,
              const LineStyle& style) {
  if (!IsFinite(from) || !IsFinite(to)) return;
  cv::line(canvas, Subpixel(from), Subpixel(to), style.colour, std::max(1, style.thickness),
           cv::LINE_AA, kSubpixelBits);
}

void DrawArrow(cv::Mat& canvas, const cv::Point2d& from, const cv::Point2d& to,
               const std::string& label, const LineStyle& style) {
  const double length = cv::norm(to - from);
  if (!IsFinite(from) || !IsFinite(to) || length == 0) return;
  const cv::Point2d direction = (to - from) / length;
  const cv::Point2d across(-direction.y, direction.x);
  const double head = std::min(kArrowHead + 2 * style.thickness, 0.5 * length);
  const cv::Point2d neck = to - head * direction;
  DrawLine(canvas, from, neck, style);
  const std::array<cv::Point, 3> triangle = {Subpixel(to), Subpixel(neck + 0.4 * head * across),
                                             Subpixel(neck - 0.4 * head * across)};
  cv::fillConvexPoly(canvas, triangle.data(), static_cast<int>(triangle.size()), style.colour,
                     cv::LINE_AA, kSubpixelBits);
  if (label.empty()) return;
  const TextStyle text{.colour = style.colour};
  const cv::Size2d size = MeasureText(label, text);
  const cv::Point2d middle = to + direction * (4 + 0.5 * std::max(size.width, size.height));
  DrawText(canvas, label, middle + cv::Point2d(-0.5 * size.width, 0.5 * size.height), text);
}

void DrawText(cv::Mat& canvas, const std::string& text, const cv::Point2d& baseline_left,
              const TextStyle& style) {
  if (!IsFinite(baseline_left)) return;
  const cv::Point origin(cvRound(std::clamp(baseline_left.x, -kFarAway, kFarAway)),
                         cvRound(std::clamp(baseline_left.y, -kFarAway, kFarAway)));
  cv::putText(canvas, text, origin, kFont, FontScale(style), style.colour, FontThickness(style),
              cv::LINE_AA);
}

cv::Size2d MeasureText(const std::string& text, const TextStyle& style) {
  int below_baseline = 0;
  return cv::getTextSize(text, kFont, FontScale(style), FontThickness(style), &below_baseline);
}

void BlendDisc(cv::Mat& canvas, const cv::Point2d& centre, double radius, const Colour& colour,
               double opacity) {
  if (!IsFinite(centre) || !(radius > 0)) return;
  const cv::Rect2d extent(centre.x - radius - 2, centre.y - radius - 2, 2 * radius + 4,
                          2 * radius + 4);
  const cv::Rect box = cv::Rect(extent & cv::Rect2d(0, 0, canvas.cols, canvas.rows));
  for (int y = box.y; y < box.y + box.height; ++y) {
    for (int x = box.x; x < box.x + box.width; ++x) {
      const double inside = radius + 0.5 - std::hypot(x + 0.5 - centre.x, y + 0.5 - centre.y);
      const double weight = std::clamp(opacity, 0.0, 1.0) * std::clamp(inside, 0.0, 1.0);
      cv::Vec3b& pixel = canvas.at<cv::Vec3b>(y, x);
      for (int c = 0; c < 3; ++c) {
        pixel[c] = cv::saturate_cast<uchar>(pixel[c] + weight * (colour[c] - pixel[c]));
      }
    }
  }
}

void DrawProbabilityBar(cv::Mat& canvas, const cv::Rect& box, double probability,
                        const Colour& colour) {
  const double share = probability > 0 ? std::min(probability, 1.0) : 0.0;
  const cv::Rect on_canvas({}, canvas.size());
  const cv::Rect filled(box.x, box.y, cvRound(share * box.width), box.height);
  canvas(box & on_canvas).setTo(Mixed(kGrey, kWhite, 0.7));
  canvas(filled & on_canvas).setTo(colour);
}

cv::Mat SideBySide(const std::vector<cv::Mat>& images, int padding, const Colour& background) {
  int width = padding, height = 0;
  for (const cv::Mat& image : images) {
    width += image.cols + padding;
    height = std::max(height, image.rows);
  }
  cv::Mat canvas(height + 2 * padding, width, CV_8UC3, background);
  int left = padding;
  for (const cv::Mat& image : images) {
    cv::Mat place =
        canvas(cv::Rect(left, padding + (height - image.rows) / 2, image.cols, image.rows));
    if (image.channels() == 1) {
      cv::cvtColor(image, place, cv::COLOR_GRAY2RGB);
    } else {
      image.copyTo(place);
    }
    left += image.cols + padding;
  }
  return canvas;
}

void DrawAxes(cv::Mat& canvas, const PinholeCamera& camera, const AxesPose& pose) {
  const Eigen::Vector3d origin(0, 0, pose.distance);
  const Eigen::Matrix3d tips = (pose.length * pose.camera_from_object).colwise() + origin;
  if (pose.distance <= 0 || !(tips.row(2).minCoeff() > 0)) return;
  const std::array<Colour, 3> colours = {kRed, kGreen, kBlue};
  const std::array<const char*, 3> names = {"X", "Y", "Z"};
  std::array<int, 3> farthest_first = {0, 1, 2};
  std::ranges::sort(farthest_first, [&](int a, int b) { return tips(2, a) > tips(2, b); });
  const auto pixel = [&](const Eigen::Vector3d& point) {
    const Eigen::Vector2d projected = camera.Project(point);
    return cv::Point2d(projected.x(), projected.y());
  };
  for (const int axis : farthest_first) {
    DrawArrow(canvas, pixel(origin), pixel(tips.col(axis)), names[axis],
              {.colour = colours[axis], .thickness = 2});
  }
}

void DrawViewSphere(cv::Mat& canvas, const ViewSphere& sphere) {
  if (!IsFinite(sphere.centre) || !(sphere.radius > 0 && sphere.radius < kFarAway)) return;
  Globe globe(canvas, sphere);
  globe.DrawWires(false);
  globe.DrawDots(false);
  globe.DrawWires(true);
  cv::circle(canvas, Subpixel(sphere.centre), cvRound(sphere.radius * kSubpixels), kGrey, 1,
             cv::LINE_AA, kSubpixelBits);
  globe.DrawDots(true);
}

}  // namespace antipode
