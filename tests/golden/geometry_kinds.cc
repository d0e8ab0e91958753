#include "geometry_kinds.h"

#include <cstdint>
#include <initializer_list>
#include <sstream>

#include <Eigen/Core>

#include "antipode/geometry/object_centric_published.h"
#include "antipode/geometry/pose_metrics.h"
#include "antipode/geometry/rotation.h"
#include "antipode/geometry/viewpoints.h"
#include "antipode/util/error.h"
#include "stored_items.h"

namespace antipode::golden {
namespace {

constexpr double kDefaultMargin = 0.05;

Eigen::Matrix4d Homogeneous(const Rigid3& pose) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topRows<3>() = pose.Matrix();
  return matrix;
}

NumericTensors LookAtCameras(const GoldenCase& golden_case) {
  const NumericTensor& intrinsics = golden_case.Stored("K");
  const NumericTensor& boxes = golden_case.Stored("bbox");
  const double margin = golden_case.config.value("margin", kDefaultMargin);
  const std::int64_t count = ItemCount(intrinsics);
  NumericTensors result = {{"R_v", NumericTensor({count, 3, 3})},
                           {"K_v", NumericTensor({count, 3, 3})},
                           {"H", NumericTensor({count, 3, 3})},
                           {"size", NumericTensor({count})},
                           {"centre", NumericTensor({count, 2})},
                           {"f_new", NumericTensor({count})},
                           {"centre_in_virtual", NumericTensor({count, 2})}};
  for (std::int64_t i = 0; i < count; ++i) {
    const published::LookAt look_at =
        published::LookAtBox(Item<3, 3>(intrinsics, i), Box(boxes, i), margin);
    Append(result["R_v"], look_at.virtual_from_camera);
    Append(result["K_v"], look_at.intrinsics);
    Append(result["H"], look_at.virtual_pixel_from_pixel);
    Append(result["size"], {static_cast<double>(look_at.size)});
    Append(result["centre"], look_at.centre);
    Append(result["f_new"], {look_at.focal_length});
    Append(result["centre_in_virtual"], look_at.centre_in_virtual);
  }
  return result;
}

NumericTensors ComposedPoses(const GoldenCase& golden_case) {
  const NumericTensor& reference_intrinsics = golden_case.Stored("K0");
  const double margin = golden_case.config.value("margin", kDefaultMargin);
  const std::int64_t count = ItemCount(reference_intrinsics);
  NumericTensors result = {{"pose_ref", NumericTensor({count, 3, 4})},
                           {"pose_query", NumericTensor({count, 3, 4})},
                           {"relative", NumericTensor({count, 3, 4})},
                           {"d_ref", NumericTensor({count})},
                           {"virtual_size", NumericTensor({count})}};
  for (std::int64_t i = 0; i < count; ++i) {
    const Eigen::Matrix3d intrinsics = Item<3, 3>(reference_intrinsics, i);
    const auto reference_look_at =
        published::LookAtBox(intrinsics, Box(golden_case.Stored("bbox0"), i), margin);
    const auto query_look_at = published::LookAtBox(Item<3, 3>(golden_case.Stored("K1"), i),
                                                    Box(golden_case.Stored("bbox1"), i), margin);
    const auto reference = published::ReferencePoseOf(
        intrinsics, reference_look_at, Number(golden_case.Stored("elev"), i),
        RadiansFromDegrees(Number(golden_case.Stored("ipr_deg"), i)));
    const Rigid3 query = published::CameraFromObject(
        query_look_at, Pose(golden_case.Stored("object_pose_query"), i));
    Append(result["pose_ref"], reference.camera_from_object.Matrix());
    Append(result["pose_query"], query.Matrix());
    Append(result["relative"],
           published::QueryFromReference(query, reference.camera_from_object).Matrix());
    Append(result["d_ref"], {reference.distance});
    Append(result["virtual_size"], {static_cast<double>(reference_look_at.size)});
  }
  return result;
}

void AppendRequests(NumericTensors& result, const std::vector<CanonicalDirection>& viewpoints,
                    double base_elevation_deg) {
  for (const CanonicalDirection& viewpoint : viewpoints) {
    const RelativeView view = RelativeViewOf(viewpoint, base_elevation_deg);
    Append(result["zero123_delta_xyz_deg"], {view.polar, view.azimuth, view.radius});
  }
  const CanonicalDirection base{.elevation = RadiansFromDegrees(base_elevation_deg)};
  Append(result["base_pose"], Homogeneous(CameraFromCanonical(base, 0.0)));
}

NumericTensors PredefinedViews(const GoldenCase& golden_case) {
  const NumericTensor& base_elevations = golden_case.Stored("base_elevation_deg");
  const std::int64_t bases = ItemCount(base_elevations);
  const std::int64_t views = golden_case.config.at("views");
  const auto viewpoints = PredefinedViewpoints(static_cast<int>(views));
  NumericTensors result = {{"elevation_azimuth_rad", NumericTensor({views, 2})},
                           {"zero123_delta_xyz_deg", NumericTensor({bases, views, 3})},
                           {"pose_unit_distance", NumericTensor({views, 3, 4})},
                           {"base_pose", NumericTensor({bases, 4, 4})},
                           {"fps_order", NumericTensor({views - 1})}};
  std::vector<Eigen::Vector3d> centres;
  for (const CanonicalDirection& viewpoint : viewpoints) {
    const Rigid3 pose = CameraFromCanonical(viewpoint, 1.0);
    Append(result["elevation_azimuth_rad"], {viewpoint.elevation, viewpoint.azimuth});
    Append(result["pose_unit_distance"], pose.Matrix());
    centres.push_back(pose.OriginInSource());
  }
  for (std::int64_t i = 0; i < bases; ++i) {
    AppendRequests(result, viewpoints, Number(base_elevations, i));
  }
  for (const std::size_t index : FarthestPointOrder(centres)) {
    Append(result["fps_order"], {static_cast<double>(index)});
  }
  return result;
}

NumericTensors ViewDistances(const GoldenCase& golden_case) {
  const NumericTensor& images = golden_case.Stored("images");
  if (images.shape.size() != 4 || images.shape[3] != 3)
    throw Error("images", "are not [N, H, W, 3]");
  const int threshold = golden_case.config.value("background_threshold", 5);
  const std::int64_t count = images.shape[0];
  const int height = static_cast<int>(images.shape[1]), width = static_cast<int>(images.shape[2]);
  const std::vector<std::uint8_t> bytes(images.values.begin(), images.values.end());
  const std::size_t image_size = std::size_t(3) * height * width;
  NumericTensors result = {{"bbox", NumericTensor({count, 4})},
                           {"K", NumericTensor({count, 3, 3})},
                           {"distance", NumericTensor({count})}};
  for (std::int64_t i = 0; i < count; ++i) {
    const auto view = published::ViewCameraOf(std::span(bytes).subspan(i * image_size, image_size),
                                              width, height, threshold);
    Append(result["bbox"], {view.box.x0, view.box.y0, view.box.x1, view.box.y1});
    Append(result["K"], view.intrinsics);
    Append(result["distance"], {view.distance});
  }
  return result;
}

/// The numbers at the end of a name: rotation_accuracy_15_30 -> 15, 30.
std::vector<double> ThresholdsOf(const std::string& name, const std::string& prefix) {
  std::istringstream parts(name.substr(prefix.size()));
  std::vector<double> thresholds;
  for (std::string part; std::getline(parts, part, '_');) thresholds.push_back(std::stod(part));
  return thresholds;
}

/// The accuracies a case lists under names that begin with `prefix`.
void AddAccuracies(NumericTensors& result, const GoldenCase& golden_case, const std::string& prefix,
                   const std::vector<double>& errors) {
  for (const TensorSpec& spec : golden_case.specs) {
    if (!spec.name.starts_with(prefix)) continue;
    NumericTensor& accuracies = result[spec.name];
    for (const double threshold : ThresholdsOf(spec.name, prefix)) {
      accuracies.values.push_back(FractionBelow(errors, threshold));
    }
    accuracies.shape = {static_cast<std::int64_t>(accuracies.values.size())};
  }
}

NumericTensors PoseMetrics(const GoldenCase& golden_case) {
  const NumericTensor& estimates = golden_case.Stored("R_pred");
  const std::int64_t count = ItemCount(estimates);
  NumericTensor rotation_errors({count}), translation_errors({count});
  for (std::int64_t i = 0; i < count; ++i) {
    Append(rotation_errors,
           {RotationErrorDeg(Item<3, 3>(estimates, i), Item<3, 3>(golden_case.Stored("R_gt"), i))});
    Append(translation_errors,
           {PublishedTranslationErrorDeg(Item<3, 1>(golden_case.Stored("t_pred"), i),
                                         Item<3, 1>(golden_case.Stored("t_gt"), i))});
  }
  NumericTensors result = {{"rotation_error_deg", rotation_errors},
                           {"translation_error_deg", translation_errors}};
  AddAccuracies(result, golden_case, "rotation_accuracy_", rotation_errors.values);
  AddAccuracies(result, golden_case, "translation_accuracy_", translation_errors.values);
  return result;
}

}  // namespace

std::vector<CatalogueEntry> GeometryKinds() {
  return {{"metrics", {"R_pred", "R_gt", "t_pred", "t_gt"}, PoseMetrics},
          {"geom_compose", {"K0", "K1", "bbox0", "bbox1", "relative"}, ComposedPoses},
          {"geom_views", {"base_elevation_deg", "elevation_azimuth_rad"}, PredefinedViews},
          {"geom_lookat", {"K", "bbox", "R_v", "K_v"}, LookAtCameras},
          {"geom_view_depth", {"images", "bbox", "distance"}, ViewDistances}};
}

}  // namespace antipode::golden
