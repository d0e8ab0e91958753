#include "orientation_kinds.h"

#include <string>

#include "antipode/geometry/rotation.h"
#include "antipode/synthesis/turned_picture.h"
#include "antipode/orientation/nearby_views.h"
#include "stored_items.h"
#include "stored_pictures.h"

namespace antipode::golden {
namespace {

NearbyCameraModel ModelOf(const nlohmann::json& config) {
  NearbyCameraModel model;
  model.distance = config.value("radius", model.distance);
  model.base_azimuth_deg = config.value("base_azimuth_deg", model.base_azimuth_deg);
  if (config.contains("K")) {
    model.focal_length = config.at("K").at(0);
    model.centre = config.at("K").at(2);
  }
  return model;
}

NumericTensors Hypotheses(const GoldenCase& golden_case) {
  const NumericTensor& polar = golden_case.Stored("polar_deg");
  const std::int64_t count = ItemCount(polar);
  NumericTensors result{{"elevation_stage", NumericTensor({count, kNearbyViews, 4, 4})},
                        {"inplane_stage", NumericTensor({count, kNearbyViews, 4, 4})}};
  const NearbyCameraModel model = ModelOf(golden_case.config);
  for (const auto& [name, order] : {std::pair{"elevation_stage", NearbyOrder::kElevationStage},
                                    {"inplane_stage", NearbyOrder::kInPlaneStage}}) {
    for (std::int64_t i = 0; i < count; ++i) {
      for (const Rigid3& camera : HypotheticalCameras(Number(polar, i), order, model)) {
        Append(result[name], camera.Inverse().Matrix());
        Append(result[name], {0, 0, 0, 1});
      }
    }
  }
  return result;
}

NearbyMatches MatchesOf(const GoldenCase& golden_case, const std::string& prefix) {
  NearbyMatches matches;
  for (int first = 0; first < kNearbyViews; ++first) {
    for (int second = first + 1; second < kNearbyViews; ++second) {
      const NumericTensor& rows = golden_case.Stored(prefix + std::to_string(first) + "_" + std::to_string(second));
      Correspondences list;
      for (std::int64_t i = 0; i < ItemCount(rows); ++i) {
        const auto row = Item<5, 1>(rows, i);
        list.reference.emplace_back(row[0], row[1]);
        list.query.emplace_back(row[2], row[3]);
        list.scores.push_back(row[4]);
      }
      matches.Set(first, second, std::move(list));
    }
  }
  return matches;
}

NumericTensors Elevations(const GoldenCase& golden_case) {
  const NearbyCameraModel model = ModelOf(golden_case.config);
  NumericTensors result{{"elevation", {}}, {"coarse_errors", {}}, {"fine_errors", {}}, {"coarse_best_polar", {}}, {"inplane_score", {}}};
  std::int64_t cases = 0;
  for (; golden_case.Lists("case" + std::to_string(cases) + "_0_1"); ++cases) {
    const std::string prefix = "case" + std::to_string(cases) + "_";
    const PublishedSearch search = SearchAsPublished(MatchesOf(golden_case, prefix), NearbyOrder::kElevationStage, model);
    const PublishedSearch in_plane = SearchAsPublished(MatchesOf(golden_case, prefix + "ipr_"), NearbyOrder::kInPlaneStage, model);
    Append(result["elevation"], {static_cast<double>(search.elevation_deg)});
    Append(result["coarse_best_polar"], {static_cast<double>(search.coarse_polar_deg)});
    Append(result["inplane_score"], {in_plane.score});
    for (const double error : search.coarse_errors) Append(result["coarse_errors"], {error});
    for (const double error : search.fine_errors) Append(result["fine_errors"], {error});
  }
  for (auto& [name, tensor] : result) {
    tensor.shape = {cases};
    const auto columns = static_cast<std::int64_t>(tensor.values.size()) / std::max<std::int64_t>(cases, 1);
    if (columns > 1) tensor.shape.push_back(columns);
  }
  return result;
}

NumericTensors InPlaneRotations(const GoldenCase& golden_case) {
  const std::vector<double>& angles = golden_case.Stored("angles_deg").values;
  const Rigid3 pose = Pose(golden_case.Stored("pose"), 0);
  std::vector<cv::Mat> pictures;
  const auto count = static_cast<std::int64_t>(angles.size());
  NumericTensors result{{"bbox_hw", NumericTensor({count, 2})}, {"camera_rotated_pose", NumericTensor({count, 3, 4})}};
  for (const TurnedPicture& turned : TurnPictures(Picture(golden_case.Stored("image"), -1), angles)) {
    Append(result["bbox_hw"], {double(turned.object.rows), double(turned.object.cols)});
    pictures.push_back(turned.padded);
  }
  for (const double angle : angles) Append(result["camera_rotated_pose"], TurnedPose(pose, angle).Matrix());
  result["canvas"] = Scalar(pictures.front().cols);
  result["images"] = ChannelsLast(pictures, FirstAxis::kWith);
  return result;
}

}  // namespace

std::vector<CatalogueEntry> OrientationKinds() {
  return {{"elev_hypotheses", {"polar_deg", "elevation_stage"}, Hypotheses},
          {"elev_estimator", {"elevation", "coarse_errors", "fine_errors"}, Elevations},
          {"inplane_rotation", {"image", "angles_deg", "camera_rotated_pose"}, InPlaneRotations}};
}

}  // namespace antipode::golden
