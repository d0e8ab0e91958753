#include "antipode/pose/halfway_matching.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/pose/view_matching.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

const cv::Vec2f kNowhere(-1e3F, -1e3F);

}  // namespace

double AngleBetweenAxesDeg(const Eigen::Matrix3d& b_from_a) { return DegreesFromRadians(std::acos(std::clamp(b_from_a(2, 2), -1.0, 1.0))); }

void HalfwayOptions::Check() const {
  if (!(dome_height >= 0)) throw InvalidOption("dome_height", "must not be negative");
  if (!(dome_radius > 0)) throw InvalidOption("dome_radius", "must be positive");
  if (!(half_width > 0)) throw InvalidOption("half_width", "must be positive");
  if (!(least_facing >= 0 && least_facing < 1)) throw InvalidOption("least_facing", "must be 0 to 1");
  if (!(greatest_angle_deg >= 0 && greatest_angle_deg < 180)) throw InvalidOption("greatest_angle_deg", "must be 0 to below 180");
}

HalfwayAxes TurnHalfway(const Eigen::Matrix3d& query_crop_from_reference_crop) {
  const Eigen::Vector3d in_reference = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d of_query = query_crop_from_reference_crop.row(2);
  const Eigen::Matrix3d from_reference =
      Eigen::Quaterniond::FromTwoVectors(in_reference + of_query, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return {from_reference, from_reference * query_crop_from_reference_crop.transpose()};
}

HalfwayView::HalfwayView(const ObjectView& crop, const Eigen::Matrix3d& halfway_from_crop, const HalfwayOptions& options)
    : crop_(crop),
      crop_from_halfway_(halfway_from_crop.transpose()),
      camera_(-crop.distance * halfway_from_crop.col(2)),
      options_(options) {
  options.Check();
}

Eigen::Vector3d HalfwayView::OnDome(const Eigen::Vector2d& pixel) const {
  const double size = crop_.image.cols;
  const Eigen::Vector2d at = (2 * options_.half_width / size) * (pixel.array() - size / 2).matrix();
  const double inside = std::max(0.0, 1 - at.squaredNorm() / (options_.dome_radius * options_.dome_radius));
  return {at.x(), at.y(), -options_.dome_height * inside};
}

Eigen::Vector2d HalfwayView::Project(const Eigen::Vector3d& on_dome) const {
  return crop_.camera.Project(crop_from_halfway_ * (on_dome - camera_));
}

bool HalfwayView::IsSeen(const Eigen::Vector3d& on_dome) const {
  const double slope = on_dome.z() < 0 ? 2 * options_.dome_height / (options_.dome_radius * options_.dome_radius) : 0;
  const Eigen::Vector3d normal(slope * on_dome.x(), slope * on_dome.y(), -1), to_camera = camera_ - on_dome;
  return normal.dot(to_camera) > options_.least_facing * normal.norm() * to_camera.norm();
}

Eigen::Vector2d HalfwayView::InCrop(const Eigen::Vector2d& pixel) const { return Project(OnDome(pixel)); }

cv::Mat HalfwayView::Image() const {
  cv::Mat places(crop_.image.size(), CV_32FC2);
  places.forEach<cv::Vec2f>([&](cv::Vec2f& place, const int* index) {
    const Eigen::Vector3d on_dome = OnDome({index[1] + 0.5, index[0] + 0.5});
    const Eigen::Vector2d pixel = Project(on_dome).array() - 0.5;
    place = IsSeen(on_dome) ? cv::Vec2f(static_cast<float>(pixel.x()), static_cast<float>(pixel.y())) : kNowhere;
  });
  cv::Mat image;
  cv::remap(crop_.image, image, places, {}, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar::all(255));
  return image;
}

Correspondences MatchHalfway(const Matcher& matcher, const ObjectView& reference, const ObjectView& query,
                             const Eigen::Matrix3d& query_crop_from_reference_crop, const HalfwayOptions& options) {
  options.Check();
  if (AngleBetweenAxesDeg(query_crop_from_reference_crop) > options.greatest_angle_deg) return {};
  const HalfwayAxes axes = TurnHalfway(query_crop_from_reference_crop);
  const HalfwayView of_reference(reference, axes.halfway_from_reference, options), of_query(query, axes.halfway_from_query, options);
  Correspondences found = matcher.Match(of_reference.Image(), of_query.Image());
  for (Eigen::Vector2d& pixel : found.reference) pixel = of_reference.InCrop(pixel);
  for (Eigen::Vector2d& pixel : found.query) pixel = of_query.InCrop(pixel);
  return OnObject(found, reference.mask, query.mask);
}

}  // namespace antipode
