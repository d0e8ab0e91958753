#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "antipode/evaluation/dataset.h"
#include "antipode/evaluation/json_file.h"
#include "antipode/render/mesh.h"
#include "antipode/render/renderer.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr char kManifest[] = "manifest.json";

fs::path FindManifest(const fs::path& root) {
  const fs::path parent = fs::absolute(root / "..").lexically_normal();
  for (const fs::path& folder : {root, parent}) {
    std::error_code ignored;
    if (fs::is_regular_file(folder / kManifest, ignored)) return folder / kManifest;
  }
  return {};
}

/// The value of a text field, empty if it is missing.
std::string Text(const fs::path& file, const nlohmann::json& entry, const char* key) {
  const auto found = entry.find(key);
  if (found == entry.end() || found->is_null()) return {};
  if (!found->is_string()) {
    throw BadFile(file.string(), std::string("the field '") + key + "' of an object is not text",
                  "correct it or take the file away");
  }
  return *found;
}

std::vector<SceneView> SceneViews(std::vector<ProtocolView> rendered) {
  std::vector<SceneView> views;
  for (ProtocolView& view : rendered) {
    views.push_back({std::to_string(views.size()),
                     {std::move(view.rendering.image), std::move(view.rendering.mask), view.camera,
                      std::move(view.rendering.depth)},
                     view.camera_from_object});
  }
  return views;
}

}  // namespace

SymmetryTable ReadSymmetryTable(const fs::path& root) {
  const fs::path file = FindManifest(root);
  if (file.empty()) return {};
  const nlohmann::json manifest = ReadJsonFile(file);
  const auto objects = manifest.find("objects");
  if (!manifest.is_object() || objects == manifest.end() || !objects->is_array()) {
    throw BadFile(file.string(), "has no list 'objects'", "correct it or take the file away");
  }
  SymmetryTable table;
  for (const nlohmann::json& entry : *objects) {
    if (!entry.is_object()) {
      throw BadFile(file.string(), "has an entry in 'objects' that is not an object",
                    "correct it or take the file away");
    }
    const std::string symmetric = Text(file, entry, "symmetric");
    const bool is_symmetric = !symmetric.empty() && symmetric != "none";
    std::string name = fs::path(Text(file, entry, "file")).stem().string();
    if (name.empty()) name = Text(file, entry, "id");
    table[name] = is_symmetric;
  }
  return table;
}

ObjectDataset::ObjectDataset(const fs::path& root, ObjectProtocolOptions options)
    : files_(FilesWithExtension(root, ".glb")),
      symmetric_(ReadSymmetryTable(root)),
      options_(options) {
  options_.Check();
}

std::size_t ObjectDataset::PairCount() const {
  return files_.size() * static_cast<std::size_t>(options_.views - 1);
}

EvaluationScene ObjectDataset::Load(std::size_t index) const {
  const fs::path& file = files_.at(index);
  EvaluationScene scene;
  scene.object = file.stem().string();
  const auto symmetric = symmetric_.find(scene.object);
  scene.symmetric = symmetric != symmetric_.end() && symmetric->second;

  Mesh mesh = LoadMesh(file);
  mesh.Normalize();
  scene.views = SceneViews(RenderProtocolViews(Renderer(std::move(mesh)), scene.object, options_));
  for (std::size_t query = 1; query < scene.views.size(); ++query)
    scene.pairs.push_back({0, query});
  return scene;
}

}  // namespace antipode
