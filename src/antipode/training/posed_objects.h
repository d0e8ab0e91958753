#pragma once

#include <filesystem>
#include <random>
#include <vector>

#include "antipode/gen6d/view_set.h"
#include "antipode/util/progress.h"

namespace antipode {

struct PosedObjectOptions {
  int views = 32;          ///< references on all sides, as `antipode reference build` renders them
  int queries = 8;         ///< from anywhere, at other distances, fields of view, lights and rolls
  int image_size = 160;    ///< pixels
  double greatest_roll_deg = 45;
  int most_objects = 0;    ///< 0: all of the folder
  std::uint64_t seed = 1;
  void Check() const;
};

/// Renderings of one object with true poses: object frame with +Z up, diameter 2, pixel centres at integers.
struct PosedObject {
  std::vector<PosedPicture> views, queries;
};

/// Renders the objects of a folder.
/// @throws Error if there is none
std::vector<PosedObject> RenderPosedObjects(const std::filesystem::path& folder, const PosedObjectOptions& options,
                                            const ProgressCallback& progress = {});

}  // namespace antipode
