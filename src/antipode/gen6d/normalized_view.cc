#include "antipode/gen6d/normalized_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/viewpoints.h"

namespace antipode {
namespace {

/// The rotation that turns the object's centre onto the optical axis, and the focal length along the ray.
struct LookAt {
  Eigen::Matrix3d rotation;
  double focal_length = 0;
};

Eigen::Matrix3d LookAtRotationOf(double x, double y, LookAtForm form) {
  if (form == LookAtForm::kPublished) return published::LookAtRotation(x, y);
  // The published form with the length that the first turn gives the ray taken into account.
  return published::LookAtRotation(x, y / std::sqrt(1 + x * x));
}

LookAt LookAtObject(const Eigen::Matrix3d& intrinsics, const Rigid3& camera_from_object, LookAtForm form) {
  const Eigen::Vector3d& centre = camera_from_object.translation;
  const double x = centre.x() / centre.z(), y = centre.y() / centre.z();
  const double focal_length = 0.5 * (intrinsics(0, 0) + intrinsics(1, 1));
  return {LookAtRotationOf(x, y, form), focal_length * std::sqrt(1 + x * x + y * y)};
}

NormalizedView Normalize(const Eigen::Matrix3d& intrinsics, const Rigid3& camera_from_object, double angle,
                         const NormalizationOptions& options) {
  NormalizedView view;
  const double distance = camera_from_object.OriginInSource().norm();
  const double focal_length = options.size * (1 - options.margin) / 2 * distance;
  view.intrinsics << focal_length, 0, 0.5 * options.size, 0, focal_length, 0.5 * options.size, 0, 0, 1;
  view.normalized_from_camera =
      RotationAboutZ(angle) * LookAtObject(intrinsics, camera_from_object, options.look_at).rotation;
  view.camera_from_object = Rigid3{view.normalized_from_camera, Eigen::Vector3d::Zero()} * camera_from_object;
  view.normalized_pixel_from_pixel = view.intrinsics * view.normalized_from_camera * intrinsics.inverse();
  return view;
}

Eigen::Vector3d ViewingDirection(const Rigid3& camera_from_object) { return camera_from_object.OriginInSource().normalized(); }

}  // namespace

NormalizedView NormalizeUpright(const Eigen::Matrix3d& intrinsics, const Rigid3& camera_from_object,
                                const NormalizationOptions& options) {
  const Eigen::Vector3d up = camera_from_object.rotation.col(2);
  return Normalize(intrinsics, camera_from_object, -std::atan2(up.y(), up.x()) - std::numbers::pi / 2, options);
}

NormalizedView NormalizeAligned(const Eigen::Matrix3d& intrinsics, const Rigid3& camera_from_object,
                                const Eigen::Matrix3d& other_intrinsics, const Rigid3& other_from_object,
                                const NormalizationOptions& options) {
  const double angle =
      InPlaneDifferenceOf(intrinsics, camera_from_object, other_intrinsics, other_from_object, options.look_at).angle;
  return Normalize(intrinsics, camera_from_object, angle, options);
}

NormalizedView NormalizeUnrotated(const Eigen::Matrix3d& intrinsics, const Rigid3& camera_from_object,
                                  const NormalizationOptions& options) {
  return Normalize(intrinsics, camera_from_object, 0, options);
}

InPlaneDifference InPlaneDifferenceOf(const Eigen::Matrix3d& first_intrinsics, const Rigid3& first_from_object,
                                      const Eigen::Matrix3d& second_intrinsics, const Rigid3& second_from_object,
                                      LookAtForm look_at) {
  const LookAt first = LookAtObject(first_intrinsics, first_from_object, look_at);
  const LookAt second = LookAtObject(second_intrinsics, second_from_object, look_at);
  const Eigen::Matrix3d turn = second.rotation * second_from_object.rotation *
                               (first.rotation * first_from_object.rotation).transpose();
  const double distances = first_from_object.OriginInSource().norm() / second_from_object.OriginInSource().norm();
  return {std::atan2(-turn(0, 1), turn(0, 0)), distances * second.focal_length / first.focal_length};
}

QueryCrop PublishedQueryCrop(const published::InclusiveBox& box, int picture_size, int crop_size, double margin) {
  const double width = box.x1 - box.x0, height = box.y1 - box.y0;
  const double wide = width + (width * margin) * 2, high = height + (height * margin) * 2;
  const double side = std::max(wide, high);
  const double left = box.x0 + (wide - side) / 2, top = box.y0 - (side - high) / 2;
  const auto low = [](double value) { return std::trunc(std::max(value, 0.0)); };
  const auto high_end = [&](double value) { return std::trunc(std::min(value, double(picture_size))); };
  const double x = (low(left) + high_end(left + side)) / 2, y = (low(top) + high_end(top + side)) / 2;
  return {{x, y}, side / crop_size};
}

QueryCrop CentredQueryCrop(const published::InclusiveBox& box, const NormalizationOptions& options) {
  const double side = std::max(box.x1 - box.x0, box.y1 - box.y0) + 1;
  return {{(box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2}, side / (options.size * (1 - options.margin))};
}

Rigid3 PoseFromSelectedView(const QueryCrop& crop, double angle, const Rigid3& view_from_object,
                            const Eigen::Matrix3d& view_intrinsics, const Eigen::Matrix3d& query_intrinsics,
                            const Eigen::Vector3d& object_centre, LookAtForm look_at) {
  const auto mean_focal_length = [](const Eigen::Matrix3d& k) { return 0.5 * (k(0, 0) + k(1, 1)); };
  const Eigen::Vector3d ray = query_intrinsics.inverse() * crop.position.homogeneous();
  const double distance = (view_from_object.OriginInSource() - object_centre).norm();
  const double along_ray = mean_focal_length(query_intrinsics) * ray.norm();
  const double query_distance = distance * along_ray / (mean_focal_length(view_intrinsics) * crop.scale);
  const Eigen::Matrix3d rotation =
      LookAtRotationOf(ray.x(), ray.y(), look_at).transpose() * RotationAboutZ(angle) * view_from_object.rotation;
  return {rotation, ray.normalized() * query_distance - rotation * object_centre};
}

std::vector<std::size_t> NearestViews(std::span<const Rigid3> views, const Rigid3& camera_from_object, std::size_t count,
                                      NeighbourPool pool) {
  std::vector<std::size_t> order(views.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (pool == NeighbourPool::kPublished) {
    std::vector<Eigen::Vector3d> centres;
    for (const Rigid3& view : views) centres.push_back(view.OriginInSource());
    order = FarthestPointOrder(centres);
  }
  const Eigen::Vector3d wanted = ViewingDirection(camera_from_object);
  std::ranges::stable_sort(order, std::ranges::greater(),
                           [&](std::size_t i) { return wanted.dot(ViewingDirection(views[i])); });
  order.resize(std::min(count, order.size()));
  return order;
}

Eigen::Matrix<double, 3, 4> SimilarityOf(const PoseChange& change, const Rigid3& camera_from_object,
                                         const Eigen::Vector3d& object_centre) {
  const Eigen::Vector3d centre = camera_from_object * object_centre;
  const Eigen::Vector3d offset(change.offset.x(), change.offset.y(), 0);
  Eigen::Matrix<double, 3, 4> similarity;
  similarity.leftCols<3>() = change.scale * change.rotation;
  similarity.col(3) = centre + offset - similarity.leftCols<3>() * centre;
  return similarity;
}

Rigid3 ApplyChange(const PoseChange& change, const Rigid3& camera_from_object, const Eigen::Vector3d& object_centre) {
  const Eigen::Vector3d centre = camera_from_object * object_centre;
  const Eigen::Vector3d offset(change.offset.x(), change.offset.y(), 0);
  const Eigen::Vector3d moved = (centre + offset) / change.scale;
  const Eigen::Matrix3d rotation = change.rotation * camera_from_object.rotation;
  return {rotation, moved - rotation * object_centre};
}

PoseChange ChangeBetween(const Eigen::Matrix3d& input_intrinsics, const Rigid3& input_from_object,
                         const Eigen::Matrix3d& query_intrinsics, const Rigid3& query_from_object) {
  const Eigen::Vector3d& input = input_from_object.translation;
  const Eigen::Vector3d& query = query_from_object.translation;
  const auto focal_length = [](const Eigen::Matrix3d& k) { return 0.5 * (k(0, 0) + k(1, 1)); };
  const double scale = input.z() / query.z() * focal_length(query_intrinsics) / focal_length(input_intrinsics);
  return {query_from_object.rotation * input_from_object.rotation.transpose(), scale, (scale * (query - input)).head<2>()};
}

}  // namespace antipode
