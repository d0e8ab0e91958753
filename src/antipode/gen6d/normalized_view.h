#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "antipode/geometry/object_centric_published.h"
#include "antipode/geometry/rigid3.h"

/// The cameras between which the selector and the refiner work. The object's centre is the origin and its diameter 2;
/// pixel centres are at integers. Formulas: Liu et al., "Gen6D", ECCV 2022, supplement.
namespace antipode {

/// How a camera is turned towards a point.
enum class LookAtForm {
  kExact,
  kPublished,  ///< Rx(atan y) Ry(atan x): up to 2.5 degrees beside the point, see geometry/object_centric_published.h
};

struct NormalizationOptions {
  int size = 128;        ///< side of the square pictures, pixels
  double margin = 0.05;  ///< share of the side that the object's sphere leaves free, both sides together
  LookAtForm look_at = LookAtForm::kExact;
};

/// A camera of `size` x `size` pixels that looks at the object's centre from where another camera stands.
struct NormalizedView {
  Eigen::Matrix3d intrinsics;               ///< focal length size (1 - margin) / 2 times the distance, centred
  Rigid3 camera_from_object;
  Eigen::Matrix3d normalized_from_camera;   ///< rotation
  Eigen::Matrix3d normalized_pixel_from_pixel;  ///< homography
};

/// Rotated so that the object's z axis points up in the picture: what the selector compares.
NormalizedView NormalizeUpright(const Eigen::Matrix3d& intrinsics, const Rigid3& camera_from_object,
                                const NormalizationOptions& options = {});

/// Rotated like the picture of another camera: what the refiner compares.
NormalizedView NormalizeAligned(const Eigen::Matrix3d& intrinsics, const Rigid3& camera_from_object,
                                const Eigen::Matrix3d& other_intrinsics, const Rigid3& other_from_object,
                                const NormalizationOptions& options = {});

/// Not rotated: the query under a pose to be refined.
NormalizedView NormalizeUnrotated(const Eigen::Matrix3d& intrinsics, const Rigid3& camera_from_object,
                                  const NormalizationOptions& options = {});

/// In-plane angle (radians) from the picture of the first camera to that of the second, and the ratio of the object's
/// sizes in them: M = (R_look,2 R_2)(R_look,1 R_1)^T, angle = atan2(-M01, M00).
struct InPlaneDifference {
  double angle = 0, scale = 1;
};
InPlaneDifference InPlaneDifferenceOf(const Eigen::Matrix3d& first_intrinsics, const Rigid3& first_from_object,
                                      const Eigen::Matrix3d& second_intrinsics, const Rigid3& second_from_object,
                                      LookAtForm look_at = LookAtForm::kExact);

/// Where the object is in the query and how large: a picture pixel p is (p - position) / scale + (64, 64) in the crop.
struct QueryCrop {
  Eigen::Vector2d position;
  double scale = 1;
};

/// The crop of the published program: its box is clamped to the picture and truncated to integers, and its margin of
/// `margin` on both sides is all added on the right and at the bottom.
QueryCrop PublishedQueryCrop(const published::InclusiveBox& box, int picture_size, int crop_size = 128, double margin = 0.1);

/// The centred crop in which the larger side of the box spans `crop_size` (1 - margin) pixels, as in the references.
QueryCrop CentredQueryCrop(const published::InclusiveBox& box, const NormalizationOptions& options = {});

/// The object pose of a query that looks like a reference view turned by `angle` (radians, clockwise on the screen)
/// and lies in the query as `crop` says.
Rigid3 PoseFromSelectedView(const QueryCrop& crop, double angle, const Rigid3& view_from_object,
                            const Eigen::Matrix3d& view_intrinsics, const Eigen::Matrix3d& query_intrinsics,
                            const Eigen::Vector3d& object_centre = Eigen::Vector3d::Zero(),
                            LookAtForm look_at = LookAtForm::kExact);

/// Which views the refiner is given.
enum class NeighbourPool {
  kAll,
  kPublished,  ///< in farthest-point order, which loses one view
};

/// The `count` views whose direction from the object's centre is nearest to that of `camera_from_object`, best first.
std::vector<std::size_t> NearestViews(std::span<const Rigid3> views, const Rigid3& camera_from_object, std::size_t count,
                                      NeighbourPool pool = NeighbourPool::kAll);

/// What the refiner changes: x -> scale rotation (x - c) + c + (offset, 0) in the camera, c the object's centre.
struct PoseChange {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  double scale = 1;
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
};

/// The change as a similarity [scale rotation | t] in camera coordinates.
Eigen::Matrix<double, 3, 4> SimilarityOf(const PoseChange& change, const Rigid3& camera_from_object,
                                         const Eigen::Vector3d& object_centre = Eigen::Vector3d::Zero());

/// The rigid pose that shows the object as the similarity does: R' = rotation R, depth z' = z / scale, and the centre
/// at (c + (offset, 0)) / c_z z'.
Rigid3 ApplyChange(const PoseChange& change, const Rigid3& camera_from_object,
                   const Eigen::Vector3d& object_centre = Eigen::Vector3d::Zero());

/// The change that takes one camera's picture of the object to another's: the refiner's supervision.
PoseChange ChangeBetween(const Eigen::Matrix3d& input_intrinsics, const Rigid3& input_from_object,
                         const Eigen::Matrix3d& query_intrinsics, const Rigid3& query_from_object);

}  // namespace antipode
