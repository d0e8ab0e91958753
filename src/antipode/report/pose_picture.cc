#include "antipode/report/pose_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/image/draw.h"
#include "antipode/report/confidence_words.h"
#include "antipode/util/formatted.h"

namespace antipode {
namespace {

constexpr int kPadding = 24;
constexpr int kPhotoSide = 470;
constexpr int kGlobeWidth = 400;
constexpr int kHypothesisSide = 236;
constexpr int kMaxHypotheses = 5;
constexpr int kTitleHeight = 44;
constexpr int kWidth = 4 * kPadding + 2 * kPhotoSide + kGlobeWidth;
constexpr int kPhotoTop = kPadding + kTitleHeight;
constexpr int kHypothesesTop = kPhotoTop + kPhotoSide + kPadding + 12;
constexpr int kCaptionHeight = 62;
constexpr int kHeight = kHypothesesTop + kTitleHeight + kHypothesisSide + kCaptionHeight + kPadding;

/// Room around the object for the axes, as a fraction of its box.
constexpr double kCropMargin = 0.3;
constexpr double kAxisLength = 1.25;  ///< object radii
constexpr double kCubeHalfSide = 0.72;

const Colour kInk(40, 40, 40);
const Colour kFaint(120, 120, 120);
const Colour kReferenceColour(255, 127, 14);
const Colour kQueryColour(148, 60, 189);

/// From the frame that is drawn (right, up, front as the reference camera sees the object) to the
/// axes of the reference camera (right, down, forward): half a turn about x.
Eigen::Matrix3d ReferenceFromDrawn() { return Eigen::Vector3d(1, -1, -1).asDiagonal(); }

/// Draws the frame of the object into a crop.
class FramePainter {
 public:
  /// @param canvas the crop `view`, drawn into
  /// @param camera_from_drawn rotation from the frame into the axes of the photograph's camera
  FramePainter(cv::Mat& canvas, const ObjectView& view, const Eigen::Matrix3d& camera_from_drawn)
      : canvas_(canvas),
        view_(view),
        crop_from_drawn_(view.crop_from_camera * camera_from_drawn),
        line_width_(std::max(2, canvas.cols / 110)) {}

  void Draw(bool with_labels) {
    struct Axis {
      Eigen::Vector3d direction;
      Colour colour;
      const char* label;
    };
    std::array<Axis, 3> axes = {Axis{Eigen::Vector3d::UnitX(), kRed, "right"},
                                Axis{Eigen::Vector3d::UnitY(), kGreen, "up"},
                                Axis{Eigen::Vector3d::UnitZ(), kBlue, "front"}};
    const auto depth = [&](const Axis& axis) { return (crop_from_drawn_ * axis.direction).z(); };
    std::ranges::sort(axes, std::greater(), depth);
    const bool front_is_near = (crop_from_drawn_ * Eigen::Vector3d::UnitZ()).z() < 0;
    if (!front_is_near) DrawFrontSide(0.35);
    for (const Axis& axis : axes) DrawAxis(axis.direction, axis.colour, with_labels ? axis.label : "");
    if (front_is_near) DrawFrontSide(0.8);
  }

 private:
  cv::Point2d Pixel(const Eigen::Vector3d& in_drawn) const {
    const Eigen::Vector3d centre(0, 0, view_.distance);
    const Eigen::Vector2d pixel = view_.camera.Project(crop_from_drawn_ * in_drawn + centre);
    return {pixel.x(), pixel.y()};
  }

  bool IsDrawable(const Eigen::Vector3d& in_drawn) const {
    return (crop_from_drawn_ * in_drawn).z() + view_.distance > 0.2;
  }

  void DrawAxis(const Eigen::Vector3d& direction, const Colour& colour, const std::string& label) {
    const Eigen::Vector3d tip = kAxisLength * direction;
    if (!IsDrawable(tip)) return;
    const cv::Point2d from = Pixel(Eigen::Vector3d::Zero()), to = Pixel(tip);
    const double dot_radius = 2.4 * line_width_;
    if (cv::norm(to - from) < 3 * dot_radius) return DrawTipFromAbove(to, tip, colour);
    const cv::Point2d before_head = to - (to - from) * std::min(1.0, 3.5 * line_width_ / cv::norm(to - from));
    DrawLine(canvas_, from, before_head, {.colour = kWhite, .thickness = line_width_ + 3});
    DrawArrow(canvas_, from, to, "", {.colour = colour, .thickness = line_width_});
    if (!label.empty()) DrawLabel(label, to + (to - from) * (20 / cv::norm(to - from)), colour);
  }

  /// An axis along the line of sight: a dot if it comes nearer, a cross if it goes away.
  void DrawTipFromAbove(const cv::Point2d& centre, const Eigen::Vector3d& tip, const Colour& colour) {
    const double radius = 3.2 * line_width_;
    BlendDisc(canvas_, centre, radius + 2, kWhite, 1);
    BlendDisc(canvas_, centre, radius, colour, 1);
    BlendDisc(canvas_, centre, radius - 2, kWhite, 1);
    if ((crop_from_drawn_ * tip).z() < 0) return BlendDisc(canvas_, centre, 0.45 * radius, colour, 1);
    const cv::Point2d arm(0.6 * radius, 0.6 * radius), other(0.6 * radius, -0.6 * radius);
    DrawLine(canvas_, centre - arm, centre + arm, {.colour = colour, .thickness = 2});
    DrawLine(canvas_, centre - other, centre + other, {.colour = colour, .thickness = 2});
  }

  void DrawLabel(const std::string& label, cv::Point2d middle, const Colour& colour) {
    const TextStyle style{.colour = colour, .height = 12};
    const cv::Size2d size = MeasureText(label, style);
    middle.x = std::clamp(middle.x, 0.5 * size.width + 4, canvas_.cols - 0.5 * size.width - 4);
    middle.y = std::clamp(middle.y, 0.5 * size.height + 4, canvas_.rows - 0.5 * size.height - 4);
    const cv::Rect box(cvRound(middle.x - 0.5 * size.width) - 4, cvRound(middle.y - 0.5 * size.height) - 4,
                       cvRound(size.width) + 8, cvRound(size.height) + 8);
    cv::rectangle(canvas_, box, kWhite, cv::FILLED);
    DrawText(canvas_, label, middle + cv::Point2d(-0.5 * size.width, 0.5 * size.height), style);
  }

  /// The front side of a cube around the object.
  void DrawFrontSide(double opacity) {
    std::array<cv::Point2d, 4> corners;
    const std::array<cv::Point, 4> signs = {cv::Point{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Eigen::Vector3d corner(signs[i].x * kCubeHalfSide, signs[i].y * kCubeHalfSide, kCubeHalfSide);
      if (!IsDrawable(corner)) return;
      corners[i] = Pixel(corner);
    }
    cv::Mat overlay = canvas_.clone();
    for (std::size_t i = 0; i < corners.size(); ++i)
      DrawLine(overlay, corners[i], corners[(i + 1) % 4], {.colour = kBlue, .thickness = 2});
    cv::addWeighted(overlay, opacity, canvas_, 1 - opacity, 0, canvas_);
  }

  cv::Mat& canvas_;
  const ObjectView& view_;
  Eigen::Matrix3d crop_from_drawn_;
  int line_width_;
};

/// The crop with the surroundings of the object shown faintly.
cv::Mat WithSurroundings(const ObjectView& view, const ObjectPhotograph& photograph) {
  constexpr double kSurroundings = 0.22;
  const Eigen::Matrix3d homography =
      CropHomography(photograph.camera, {view.camera, view.crop_from_camera});
  cv::Mat around, faint;
  cv::warpPerspective(photograph.image, around, HomographyForOpenCv(homography), view.image.size(), cv::INTER_LINEAR,
                      cv::BORDER_CONSTANT, kWhite);
  cv::addWeighted(around, kSurroundings, cv::Mat(around.size(), CV_8UC3, kWhite), 1 - kSurroundings, 0, faint);
  cv::Mat result = view.image.clone();
  for (int y = 0; y < result.rows; ++y) {
    for (int x = 0; x < result.cols; ++x) {
      const double cover = view.mask.at<std::uint8_t>(y, x) / 255.0;
      auto& pixel = result.at<cv::Vec3b>(y, x);
      const auto& behind = faint.at<cv::Vec3b>(y, x);
      // The crop is white where the mask is empty: put the surroundings in place of that white.
      for (int c = 0; c < 3; ++c)
        pixel[c] = cv::saturate_cast<std::uint8_t>(pixel[c] + (1 - cover) * (behind[c] - 255.0));
    }
  }
  return result;
}

/// A crop of a photograph with room around the object, on which frames can be drawn.
class ObjectPanel {
 public:
  ObjectPanel(const ObjectPhotograph& photograph, int side)
      : view_(MakeObjectView(photograph.image, photograph.mask, photograph.camera,
                             {.size = side, .margin = kCropMargin})),
        picture_(WithSurroundings(view_, photograph)) {}

  /// A copy with the frame as it stands before this camera.
  cv::Mat WithFrame(const Eigen::Matrix3d& camera_from_drawn, bool with_labels) const {
    cv::Mat copy = picture_.clone();
    FramePainter(copy, view_, camera_from_drawn).Draw(with_labels);
    return copy;
  }

 private:
  ObjectView view_;
  cv::Mat picture_;
};

/// A globe in parallel projection, as `DrawViewSphere` draws it, with the way from one camera to the
/// other.
class CameraGlobe {
 public:
  CameraGlobe(const Eigen::Vector3d& reference, const Eigen::Vector3d& query)
      : reference_(reference.normalized()), query_(query.normalized()) {
    sphere_.viewer_elevation_deg = 22;
    sphere_.viewer_azimuth_deg = ViewerAzimuthDeg();
    sphere_.dots = {{reference_, kReferenceColour, ""}, {query_, kQueryColour, ""}};
  }

  void Draw(cv::Mat& canvas, const cv::Point2d& centre, double radius) {
    sphere_.centre = centre;
    sphere_.radius = radius;
    DrawViewSphere(canvas, sphere_);
    DrawWay(canvas);
    const bool reference_is_left = Seen(reference_).x() <= Seen(query_).x();
    DrawName(canvas, reference_, {"reference", kReferenceColour, reference_is_left});
    DrawName(canvas, query_, {"query", kQueryColour, !reference_is_left});
  }

 private:
  /// Turned so that the middle between both cameras is in front, and away from seeing one end on.
  double ViewerAzimuthDeg() const {
    const Eigen::Vector3d middle = reference_ + query_;
    if (std::hypot(middle.x(), middle.z()) < 0.3) return 40;
    return DegreesFromRadians(std::atan2(middle.x(), middle.z())) + 20;
  }

  Eigen::Vector3d Seen(const Eigen::Vector3d& direction) const {
    return RotationAboutX(RadiansFromDegrees(sphere_.viewer_elevation_deg)) *
           RotationAboutY(-RadiansFromDegrees(sphere_.viewer_azimuth_deg)) * direction;
  }

  cv::Point2d Pixel(const Eigen::Vector3d& seen) const {
    return sphere_.centre + sphere_.radius * cv::Point2d(seen.x(), -seen.y());
  }

  /// The shorter great circle between the cameras.
  void DrawWay(cv::Mat& canvas) const {
    constexpr int kSegments = 48;
    const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(reference_, query_);
    const auto point = [&](int i) {
      return Seen(Eigen::Quaterniond::Identity().slerp(static_cast<double>(i) / kSegments, turn) * reference_);
    };
    for (int i = 0; i < kSegments; ++i) {
      const Eigen::Vector3d from = point(i), to = point(i + 1);
      if (from.z() < 0 && i % 2 == 1) continue;  // dashed behind the globe
      DrawLine(canvas, Pixel(from), Pixel(to),
               {.colour = from.z() < 0 ? kFaint : kInk, .thickness = from.z() < 0 ? 1 : 2});
    }
  }

  struct Name {
    std::string text;
    Colour colour;
    bool is_left;  ///< of its dot
  };

  void DrawName(cv::Mat& canvas, const Eigen::Vector3d& direction, const Name& name) const {
    const TextStyle style{.colour = name.colour, .height = 11};
    const cv::Size2d size = MeasureText(name.text, style);
    const cv::Point2d pixel = Pixel(Seen(direction));
    const double x = name.is_left ? pixel.x - 14 - size.width : pixel.x + 14;
    const double half_width = 0.5 * kGlobeWidth;
    const cv::Point2d origin(
        std::clamp(x, sphere_.centre.x - half_width, sphere_.centre.x + half_width - size.width),
        pixel.y + 0.5 * size.height);
    cv::rectangle(canvas, cv::Rect(cvRound(origin.x) - 3, cvRound(origin.y - size.height) - 3,
                                   cvRound(size.width) + 6, cvRound(size.height) + 6),
                  kWhite, cv::FILLED);
    DrawText(canvas, name.text, origin, style);
  }

  Eigen::Vector3d reference_, query_;
  ViewSphere sphere_;
};

void DrawTitle(cv::Mat& canvas, const std::string& text, int left, int top, const Colour& colour) {
  DrawText(canvas, text, {static_cast<double>(left), top + 22.0}, {.colour = colour, .height = 16});
}

void DrawCentred(cv::Mat& canvas, const std::string& text, const cv::Point2d& middle, const TextStyle& style) {
  const cv::Size2d size = MeasureText(text, style);
  DrawText(canvas, text, middle + cv::Point2d(-0.5 * size.width, 0.5 * size.height), style);
}

void Place(cv::Mat& canvas, const cv::Mat& picture, const cv::Point& at, const Colour& frame) {
  picture.copyTo(canvas(cv::Rect(at, picture.size())));
  cv::rectangle(canvas, cv::Rect(at, picture.size()), frame, 2);
}

std::string Percent(double share) { return Formatted("%.0f %%", 100 * share); }

void DrawConfidence(cv::Mat& canvas, double confidence, int left, int top) {
  const Colour colour = ConfidenceColour(confidence);
  DrawText(canvas, "confidence " + Percent(confidence), {static_cast<double>(left), top + 14.0},
           {.colour = kInk, .height = 14});
  DrawProbabilityBar(canvas, {left, top + 26, kGlobeWidth, 22}, confidence, colour);
  DrawText(canvas, ConfidenceWords(confidence), {static_cast<double>(left), top + 70.0},
           {.colour = colour, .height = 13});
}

void DrawGlobePanel(cv::Mat& canvas, const TwoViewPose& pose) {
  const int left = 3 * kPadding + 2 * kPhotoSide;
  const Eigen::Matrix3d drawn_from_reference = ReferenceFromDrawn().transpose();
  const Eigen::Vector3d centre =
      pose.reference.crop_from_camera.transpose() * Eigen::Vector3d(0, 0, pose.reference.distance);
  const Eigen::Vector3d reference = -centre;
  const Eigen::Vector3d query = pose.query_from_reference.OriginInSource() - centre;
  const double between = DegreesFromRadians(
      std::atan2(reference.cross(query).norm(), reference.dot(query)));
  DrawTitle(canvas, "cameras around the object", left, kPadding, kInk);
  CameraGlobe(drawn_from_reference * reference, drawn_from_reference * query)
      .Draw(canvas, {left + 0.5 * kGlobeWidth, kPhotoTop + 150.0}, 112);
  DrawCentred(canvas, Formatted("%.0f degrees apart", between), {left + 0.5 * kGlobeWidth, kPhotoTop + 300.0},
              {.colour = kInk, .height = 14});
  DrawCentred(canvas,
              Formatted("camera turned by %.0f degrees", RotationAngleDeg(pose.query_from_reference.rotation)),
              {left + 0.5 * kGlobeWidth, kPhotoTop + 328.0}, {.colour = kFaint, .height = 12});
  DrawConfidence(canvas, pose.confidence, left, kPhotoTop + kPhotoSide - 80);
}

void DrawHypothesis(cv::Mat& canvas, const PoseHypothesis& hypothesis, const ObjectPanel& panel,
                    int index) {
  const bool is_best = index == 0;
  const int left = kPadding + index * (kHypothesisSide + kPadding);
  const int top = kHypothesesTop + kTitleHeight;
  Place(canvas, panel.WithFrame(hypothesis.query_from_reference.rotation * ReferenceFromDrawn(), false),
        {left, top}, is_best ? kQueryColour : kGrey);
  const int below = top + kHypothesisSide;
  DrawProbabilityBar(canvas, {left, below + 12, kHypothesisSide, 14}, hypothesis.probability,
                     is_best ? kQueryColour : kFaint);
  const std::string text = Percent(hypothesis.probability) + ", turned by " +
      Formatted("%.0f degrees", RotationAngleDeg(hypothesis.query_from_reference.rotation));
  DrawText(canvas, text, {static_cast<double>(left), below + 48.0}, {.colour = kInk, .height = 11});
}

}  // namespace

cv::Mat DrawPosePicture(const TwoViewPose& pose, const ObjectPhotograph& reference,
                        const ObjectPhotograph& query) {
  cv::Mat canvas(kHeight, kWidth, CV_8UC3, kWhite);
  const Eigen::Matrix3d query_from_drawn = pose.query_from_reference.rotation * ReferenceFromDrawn();
  DrawTitle(canvas, "reference", kPadding, kPadding, kReferenceColour);
  DrawTitle(canvas, "query, as estimated", 2 * kPadding + kPhotoSide, kPadding, kQueryColour);
  Place(canvas, ObjectPanel(reference, kPhotoSide).WithFrame(ReferenceFromDrawn(), true),
        {kPadding, kPhotoTop}, kReferenceColour);
  Place(canvas, ObjectPanel(query, kPhotoSide).WithFrame(query_from_drawn, true),
        {2 * kPadding + kPhotoSide, kPhotoTop}, kQueryColour);
  DrawGlobePanel(canvas, pose);

  DrawTitle(canvas, "hypotheses, the most probable first", kPadding, kHypothesesTop, kInk);
  const ObjectPanel small_panel(query, kHypothesisSide);
  const int count = std::min<int>(kMaxHypotheses, static_cast<int>(pose.hypotheses.size()));
  for (int i = 0; i < count; ++i) DrawHypothesis(canvas, pose.hypotheses[i], small_panel, i);
  return canvas;
}

}  // namespace antipode
