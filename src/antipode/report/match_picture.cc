#include "antipode/report/match_picture.h"

#include <opencv2/imgproc.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/image/draw.h"
#include "antipode/util/formatted.h"

namespace antipode {
namespace {

constexpr int kPadding = 12;
constexpr int kCaption = 34;
constexpr double kFaintness = 0.8;  // of wrong matches

cv::Point2d Placed(const Eigen::Vector2d& pixel, const cv::Point& corner) {
  return {pixel.x() + corner.x, pixel.y() + corner.y};
}

/// Hue from left to right, light from top to bottom.
Colour PlaceColour(const Eigen::Vector2d& pixel, double side) {
  const double x = std::clamp(pixel.x() / side, 0.0, 1.0), y = std::clamp(pixel.y() / side, 0.0, 1.0);
  cv::Mat hsv(1, 1, CV_8UC3, cv::Scalar(150 * x, 230, 235 - 110 * y)), rgb;
  cv::cvtColor(hsv, rgb, cv::COLOR_HSV2RGB);
  const cv::Vec3b value = rgb.at<cv::Vec3b>(0, 0);
  return {static_cast<double>(value[0]), static_cast<double>(value[1]), static_cast<double>(value[2])};
}

void DrawMatches(cv::Mat& canvas, const MatchedViews& matched, bool consistent, const cv::Point& left, const cv::Point& right,
                 double side) {
  for (std::size_t i = 0; i < matched.correspondences.size(); ++i) {
    if ((matched.geometry.is_inlier[i] != 0) != consistent) continue;
    const Colour colour = consistent ? PlaceColour(matched.correspondences.reference[i], side) : kGrey;
    const cv::Point2d from = Placed(matched.correspondences.reference[i], left);
    const cv::Point2d to = Placed(TurnPixel(matched.correspondences.query[i], matched.quarter_turns, side), right);
    DrawLine(canvas, from, to, {.colour = colour});
    if (!consistent) continue;
    BlendDisc(canvas, from, 2.5, colour, 1);
    BlendDisc(canvas, to, 2.5, colour, 1);
  }
}

std::string Caption(const MatchedViews& matched) {
  const TwoViewGeometry& geometry = matched.geometry;
  std::string text = Formatted("%zu matches, %d consistent: %s", matched.correspondences.size(), geometry.inliers,
                               NameOf(geometry.status).c_str());
  if (geometry.status != TwoViewStatus::kTooFewMatches)
    text += Formatted(", rotation %.1f +- %.1f degrees", RotationAngleDeg(geometry.query_from_reference.rotation),
                      std::min(geometry.RotationDeviationDeg(), 180.0));
  if (matched.quarter_turns != 0) text += Formatted("; query turned by %d degrees", 90 * matched.quarter_turns);
  return text;
}

}  // namespace

cv::Mat DrawMatchPicture(const ObjectView& reference, const ObjectView& query, const MatchedViews& matched) {
  const int side = reference.image.cols;
  cv::Mat canvas(side + 2 * kPadding + kCaption, 2 * side + 3 * kPadding, CV_8UC3, kWhite);
  const cv::Point left(kPadding, kPadding), right(2 * kPadding + side, kPadding);
  reference.image.copyTo(canvas(cv::Rect(left, reference.image.size())));
  const cv::Mat turned = QuarterTurned(query.image, matched.quarter_turns);
  turned.copyTo(canvas(cv::Rect(right, turned.size())));
  cv::Mat plain = canvas.clone();
  DrawMatches(canvas, matched, false, left, right, side);
  cv::addWeighted(plain, kFaintness, canvas, 1 - kFaintness, 0, canvas);
  DrawMatches(canvas, matched, true, left, right, side);
  DrawText(canvas, Caption(matched), cv::Point2d(kPadding, side + kPadding + kCaption - 10), {.colour = kBlack, .height = 10});
  return canvas;
}

}  // namespace antipode
