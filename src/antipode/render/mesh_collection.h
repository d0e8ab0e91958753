#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "antipode/render/mesh.h"

namespace antipode {

class MeshPack;

/// The meshes of a folder of .glb files, or of a pack of such files (PackMeshes), sorted by name. Nothing is loaded
/// before it is asked for. Thread safe; copies share an open pack.
class MeshCollection {
 public:
  /// @throws BadFile if `path` is neither, or there is no mesh in it
  static MeshCollection Open(const std::filesystem::path& path);

  std::size_t size() const { return names_.size(); }
  /// Of the file, also if it was packed: "chair.glb".
  const std::string& Name(std::size_t index) const { return names_[index]; }
  /// Neither centred nor scaled. @throws BadFile if it cannot be read
  Mesh Load(std::size_t index) const;

  /// Of each file in bytes, which tells apart folders with the same names; empty for a pack.
  std::vector<std::uintmax_t> FileSizes() const;
  /// SHA-256, which tells apart packs; empty for a folder.
  std::string PackDigest() const;

 private:
  std::filesystem::path path_;
  std::vector<std::string> names_;
  std::shared_ptr<const MeshPack> pack_;  // null for a folder
};

}  // namespace antipode
