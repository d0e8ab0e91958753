#pragma once

#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "antipode/geometry/rigid3.h"
#include "antipode/render/mesh_collection.h"
#include "antipode/render/renderer.h"
#include "antipode/util/memory_map.h"
#include "antipode/util/progress.h"

namespace antipode {

struct ViewCacheOptions {
  int views_per_object = 24;  ///< of every variant
  /// The first is the object itself; then, in turn: stretched, stretched and retextured, stretched and joined
  /// with another object.
  int variants = 4;
  double stretch = 1.35;      ///< greatest factor between the axes of a stretched variant
  int image_size = 160;       ///< pixels; the object's box fills 1 / (1 + 2 margin) of it
  double margin = 0.19;       ///< room for in-plane rotation and jitter of the crop
  double wide_share = 0.35;   ///< share of views at elevations -80..85, the rest at -5..65 degrees
  std::uint64_t seed = 1;
  int threads = 2;
  void Check() const;
};

/// From the front, mostly from above; between nearly shadowless and harsh.
RenderOptions RandomLight(std::mt19937_64& random);

/// Object-centric renderings of many objects on disk, mapped into memory: the food of the trainers.
///
/// A folder with `views.json` (options and objects), `cameras.safetensors` (rotation F64 [V, 3, 3], centre F64 [V, 3], focal
/// length F64 [V]) and `views.raw` (RGBA, U8 [V, S, S, 4], white where alpha is 0).
class ViewCache {
 public:
  /// Opens the cache in `folder`, or renders it first if it is missing or was made with other options or
  /// from other objects: for a folder their names and sizes count, for a pack its bytes.
  /// @throws Interrupted if `progress` does; nothing is left behind then
  static ViewCache OpenOrRender(const std::filesystem::path& folder,
                                const MeshCollection& meshes,
                                const ViewCacheOptions& options, const ProgressCallback& progress);

  int group_count() const { return group_count_; }  ///< variants of objects
  int views_per_group() const { return views_per_group_; }
  int image_size() const { return image_size_; }

  /// RGBA, 8UC4; a view of mapped memory, do not write.
  cv::Mat Image(int group, int view) const;
  /// The origin is the middle of the object, the unit its radius.
  const Rigid3& CameraFromObject(int group, int view) const;
  double FocalLength(int group, int view) const;  ///< pixels; the principal point is the centre

 private:
  explicit ViewCache(const std::filesystem::path& folder);
  std::size_t Index(int group, int view) const;

  int group_count_ = 0, views_per_group_ = 0, image_size_ = 0;
  std::vector<Rigid3> poses_;
  std::vector<double> focal_lengths_;
  MemoryMap pixels_;
};

}  // namespace antipode
