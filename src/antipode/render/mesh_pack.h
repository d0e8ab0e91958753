#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "antipode/render/mesh.h"
#include "antipode/util/progress.h"
#include "antipode/weights/archive.h"

namespace antipode {

class MeshCollection;

struct MeshPackOptions {
  double megabytes = 28;  ///< greatest size of the file, in units of 2^20 bytes
  void Check() const;
};

struct MeshPackResult {
  std::int64_t objects = 0, triangles = 0, textures = 0;
  std::uint64_t bytes = 0;  ///< of the file
  int texture_side = 0;     ///< pixels; larger textures were reduced to it, 0 if there are none
  /// Of all vertices of all objects, in radii of the smallest sphere around the object.
  double greatest_position_error = 0;
};

/// Writes all meshes into one file for training elsewhere: a zip archive with an entry `antipode-meshes` (u32 version, u32
/// textures, then the names, each ended by 0), entries `mesh N` (EncodeMesh, deflated) and `texture N` (JPEG of quality 85, or
/// PNG where that is smaller). Textures that look the same are kept once, and all are reduced to the greatest side of
/// 512, 384, 256, 192, 128, 96, 64 and 32 pixels with which the file fits. The same meshes give the same bytes.
/// @throws Error if it does not fit, or the file cannot be written; whatever loading the meshes or `progress` throws
MeshPackResult PackMeshes(const MeshCollection& meshes, const std::filesystem::path& file, const MeshPackOptions& options,
                          const ProgressCallback& progress);

/// Reads such a file. Thread safe.
class MeshPack {
 public:
  /// @throws BadFile if it is not a whole pack
  explicit MeshPack(const std::filesystem::path& file);

  const std::vector<std::string>& names() const { return names_; }
  /// @throws BadFile if the mesh is damaged
  Mesh Load(std::size_t index) const;

 private:
  std::vector<std::byte> Read(const std::string& entry) const;
  cv::Mat LoadTexture(std::uint32_t number) const;

  std::string subject_;
  ZipArchive archive_;
  mutable std::mutex mutex_;  // an archive is read at one place at a time
  std::vector<std::string> names_;
  std::uint32_t textures_ = 0;
};

}  // namespace antipode
