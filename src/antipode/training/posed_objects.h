#pragma once

#include <filesystem>
#include <random>
#include <vector>

#include "antipode/gen6d/view_set.h"
#include "antipode/util/progress.h"

namespace antipode {

struct PosedObjectOptions {
  int views = 64;              ///< references on all sides, as `antipode reference build` renders them
  int query_groups = 4;        ///< from anywhere, at other distances, fields of view, lights and rolls
  int queries_per_group = 8;   ///< from near each other
  double greatest_error_deg = 30;  ///< of a group's coarse pose
  int image_size = 160;    ///< pixels
  double greatest_roll_deg = 45;
  int most_objects = 0;    ///< 0: all
  std::uint64_t seed = 1;
  void Check() const;
};

/// Pictures of one camera model to which one coarse pose belongs: theirs with errors of rotation, place (0.1 radii)
/// and size (2^0.2).
struct QueryGroup {
  Rigid3 coarse_camera_from_object;
  std::vector<PosedPicture> queries;
};

/// Renderings of one object with true poses: object frame with +Z up, diameter 2, pixel centres at integers.
struct PosedObject {
  std::vector<PosedPicture> views;
  std::vector<QueryGroup> groups;
};

/// Renders the objects of a folder or pack (MeshCollection).
/// @throws Error if there is none
std::vector<PosedObject> RenderPosedObjects(const std::filesystem::path& meshes, const PosedObjectOptions& options,
                                            const ProgressCallback& progress = {});

}  // namespace antipode
