#include "antipode/render/mesh_collection.h"

#include "antipode/render/mesh_pack.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"

namespace antipode {

MeshCollection MeshCollection::Open(const std::filesystem::path& path) {
  MeshCollection meshes;
  meshes.path_ = path;
  if (std::filesystem::is_regular_file(path)) {
    meshes.pack_ = std::make_shared<const MeshPack>(path);
    meshes.names_ = meshes.pack_->names();
    return meshes;
  }
  if (!std::filesystem::exists(path))
    throw BadFile(path.string(), "does not exist", "give a folder of .glb files, or a pack made by antipode train pack");
  for (const auto& file : FilesWithExtension(path, ".glb")) meshes.names_.push_back(file.filename().string());
  return meshes;
}

Mesh MeshCollection::Load(std::size_t index) const {
  return pack_ ? pack_->Load(index) : LoadMesh(path_ / names_.at(index));
}

std::vector<std::uintmax_t> MeshCollection::FileSizes() const {
  std::vector<std::uintmax_t> sizes;
  if (pack_) return sizes;
  for (const std::string& name : names_) sizes.push_back(std::filesystem::file_size(path_ / name));
  return sizes;
}

std::string MeshCollection::PackDigest() const { return pack_ ? Sha256OfFile(path_) : std::string(); }

}  // namespace antipode
