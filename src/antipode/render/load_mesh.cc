#ifndef ANTIPODE_MESH_FILES

#include "antipode/render/mesh.h"
#include "antipode/util/error.h"

antipode::Mesh antipode::LoadMesh(const std::filesystem::path& path) {
  throw BadFile(path.string(), "cannot be read: this program was built without assimp",
                "give a pack of meshes (antipode train pack), or build with -DANTIPODE_MESH_FILES=ON");
}

#else

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <assimp/Importer.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "antipode/render/mesh.h"
#include "antipode/render/srgb.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr char kHowToGiveAMesh[] = "give a .glb, .gltf, .obj or .ply file";

// glTF counts v from the top; assimp's readers give it from the bottom.
constexpr unsigned kPostProcessing = aiProcess_Triangulate | aiProcess_SortByPType |
                                     aiProcess_FlipUVs | aiProcess_ValidateDataStructure;

void RequireFile(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) {
    throw BadFile(path.string(), "does not exist", "check the spelling of the path");
  }
  if (fs::is_directory(path, ignored)) {
    throw BadFile(path.string(), "is a folder", kHowToGiveAMesh);
  }
  if (!fs::is_regular_file(path, ignored)) {
    throw BadFile(path.string(), "is not an ordinary file", kHowToGiveAMesh);
  }
  if (fs::file_size(path, ignored) == 0) {
    throw BadFile(path.string(), "is empty", kHowToGiveAMesh);
  }
}

bool IsGltf(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".glb" || extension == ".gltf";
}

Eigen::Vector3f FromAssimp(const aiVector3D& v) { return {v.x, v.y, v.z}; }

Eigen::Affine3f FromAssimp(const aiMatrix4x4& m) {
  Eigen::Affine3f transform;
  transform.matrix() << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, 0,
      0, 0, 1;
  return transform;
}

/// "a%20b" -> "a b": references in glTF are URIs.
std::string DecodedUri(const std::string& uri) {
  std::string decoded;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const bool escaped = uri[i] == '%' && i + 2 < uri.size() &&
                         std::isxdigit(static_cast<unsigned char>(uri[i + 1])) &&
                         std::isxdigit(static_cast<unsigned char>(uri[i + 2]));
    if (!escaped) {
      decoded += uri[i];
      continue;
    }
    decoded += static_cast<char>(std::stoi(uri.substr(i + 1, 2), nullptr, 16));
    i += 2;
  }
  return decoded;
}

/// Reads the meshes of one assimp scene into one Mesh.
class SceneReader {
 public:
  SceneReader(const aiScene& scene, const fs::path& path)
      : scene_(scene), path_(path), linear_colors_(IsGltf(path)) {}

  Mesh Read() {
    ReadMaterials();
    ReadNode(*scene_.mRootNode, Eigen::Affine3f::Identity());
    DropUnusedAttributes();
    return std::move(mesh_);
  }

 private:
  void ReadMaterials() {
    for (unsigned i = 0; i < scene_.mNumMaterials; ++i) ReadMaterial(*scene_.mMaterials[i]);
    if (mesh_.materials.empty()) {
      mesh_.materials.emplace_back();
      texcoord_sets_.push_back(0);
    }
  }

  void ReadMaterial(const aiMaterial& source) {
    Material material;
    aiColor4D color;
    if (source.Get(AI_MATKEY_BASE_COLOR, color) == aiReturn_SUCCESS ||
        source.Get(AI_MATKEY_COLOR_DIFFUSE, color) == aiReturn_SUCCESS) {
      material.base_color = LinearColor(color);
    }
    aiString reference;
    unsigned texcoord_set = 0;
    for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}) {
      if (source.GetTexture(type, 0, &reference, nullptr, &texcoord_set) != aiReturn_SUCCESS) {
        continue;
      }
      material.texture = ReadTexture(reference);
      break;
    }
    mesh_.materials.push_back(std::move(material));
    texcoord_sets_.push_back(std::min<unsigned>(texcoord_set, AI_MAX_NUMBER_OF_TEXTURECOORDS - 1));
  }

  Eigen::Vector3f LinearColor(const aiColor4D& color) const {
    const Eigen::Vector3f stored = Eigen::Vector3f(color.r, color.g, color.b).cwiseMax(0.f);
    if (!stored.allFinite()) throw Bad("has a colour that is not finite");
    return linear_colors_ ? stored : Eigen::Vector3f(stored.unaryExpr(&LinearFromSrgb));
  }

  cv::Mat ReadTexture(const aiString& reference) const {
    if (const aiTexture* embedded = scene_.GetEmbeddedTexture(reference.C_Str())) {
      return ReadEmbeddedTexture(*embedded);
    }
    std::string name = DecodedUri(reference.C_Str());
    std::replace(name.begin(), name.end(), '\\', '/');
    const fs::path file = path_.parent_path() / name;
    std::error_code ignored;
    if (!fs::is_regular_file(file, ignored)) {
      throw BadFile(path_.string(), "refers to the texture " + Quoted(name) + ", which is missing",
                    "put the texture there");
    }
    const std::string bytes = ReadFile(file);
    return Decoded({bytes.begin(), bytes.end()}, file);
  }

  cv::Mat ReadEmbeddedTexture(const aiTexture& texture) const {
    const auto* bytes = reinterpret_cast<const unsigned char*>(texture.pcData);
    if (texture.mHeight == 0) return Decoded({bytes, bytes + texture.mWidth}, path_);
    cv::Mat texels(static_cast<int>(texture.mHeight), static_cast<int>(texture.mWidth), CV_8UC3);
    for (int i = 0; i < texels.rows; ++i) {
      for (int j = 0; j < texels.cols; ++j) {
        const aiTexel& texel = texture.pcData[static_cast<std::size_t>(i) * texture.mWidth + j];
        texels.at<cv::Vec3b>(i, j) = {texel.r, texel.g, texel.b};
      }
    }
    return texels;
  }

  /// @param file named if the picture cannot be read
  static cv::Mat Decoded(const std::vector<unsigned char>& bytes, const fs::path& file) {
    cv::Mat bgr;
    try {
      if (!bytes.empty())
        bgr = cv::imdecode(bytes, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
    } catch (const cv::Exception&) {
      bgr.release();
    }
    if (bgr.empty()) {
      throw BadFile(file.string(), "has a texture that cannot be decoded",
                    "save its textures as JPEG or PNG");
    }
    cv::Mat rgb;
    cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
    return rgb;
  }

  void ReadNode(const aiNode& node, const Eigen::Affine3f& root_from_parent) {
    const Eigen::Affine3f root_from_node = root_from_parent * FromAssimp(node.mTransformation);
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      ReadPart(*scene_.mMeshes[node.mMeshes[i]], root_from_node);
    }
    for (unsigned i = 0; i < node.mNumChildren; ++i) ReadNode(*node.mChildren[i], root_from_node);
  }

  void ReadPart(const aiMesh& part, const Eigen::Affine3f& root_from_node) {
    if (!(part.mPrimitiveTypes & aiPrimitiveType_TRIANGLE) || part.mNumFaces == 0) return;
    const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
    ReadVertices(part, root_from_node);
    ReadTriangles(part, first, root_from_node.linear().determinant() < 0);
    if (part.HasNormals()) {
      ReadNormals(part, root_from_node.linear());
    } else {
      GiveFlatNormals(first, mesh_.triangles.size() - part.mNumFaces);
    }
  }

  void ReadVertices(const aiMesh& part, const Eigen::Affine3f& root_from_node) {
    const aiVector3D* texcoords = part.mTextureCoords[texcoord_sets_[MaterialOf(part)]];
    const aiColor4D* colors = part.mColors[0];
    has_texcoords_ = has_texcoords_ || texcoords;
    has_colors_ = has_colors_ || colors;
    for (unsigned i = 0; i < part.mNumVertices; ++i) {
      const Eigen::Vector3f position = root_from_node * FromAssimp(part.mVertices[i]);
      if (!position.allFinite()) throw Bad("has a vertex that is not finite");
      mesh_.positions.push_back(position);
      mesh_.colors.push_back(colors ? LinearColor(colors[i]) : Eigen::Vector3f::Ones());
      const Eigen::Vector2f texcoord =
          texcoords ? Eigen::Vector2f(texcoords[i].x, texcoords[i].y) : Eigen::Vector2f(0, 0);
      // Some exporters leave NaN where a face has no area on the texture.
      mesh_.texcoords.push_back(texcoord.allFinite() ? texcoord : Eigen::Vector2f(0, 0));
    }
  }

  std::uint16_t MaterialOf(const aiMesh& part) const {
    if (part.mMaterialIndex >= mesh_.materials.size()) return 0;
    return static_cast<std::uint16_t>(part.mMaterialIndex);
  }

  void ReadTriangles(const aiMesh& part, std::uint32_t first, bool mirrored) {
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
      const aiFace& face = part.mFaces[i];
      if (face.mNumIndices != 3 ||
          *std::max_element(face.mIndices, face.mIndices + 3) >= part.mNumVertices) {
        throw Bad("has a face that refers to a missing vertex");
      }
      const std::uint32_t a = first + face.mIndices[0];
      const std::uint32_t b = first + face.mIndices[mirrored ? 2 : 1];
      const std::uint32_t c = first + face.mIndices[mirrored ? 1 : 2];
      mesh_.triangles.emplace_back(a, b, c);
      mesh_.triangle_materials.push_back(MaterialOf(part));
    }
  }

  void ReadNormals(const aiMesh& part, const Eigen::Matrix3f& linear) {
    // The cofactor matrix is the inverse transpose up to a positive factor and the sign of the
    // determinant, and exists for flattening transforms too.
    Eigen::Matrix3f cofactor;
    cofactor << linear.col(1).cross(linear.col(2)), linear.col(2).cross(linear.col(0)),
        linear.col(0).cross(linear.col(1));
    if (linear.determinant() < 0) cofactor = -cofactor;
    for (unsigned i = 0; i < part.mNumVertices; ++i) {
      const Eigen::Vector3f normal = (cofactor * FromAssimp(part.mNormals[i])).stableNormalized();
      const bool usable = normal.allFinite() && normal.squaredNorm() > 0.5f;
      mesh_.normals.push_back(usable ? normal : Eigen::Vector3f::UnitY());
    }
  }

  /// Gives each triangle from `first_triangle` on three vertices of its own, from `first_vertex`
  /// on.
  void GiveFlatNormals(std::uint32_t first_vertex, std::size_t first_triangle) {
    const auto tail = [first_vertex](auto& values) {
      std::remove_reference_t<decltype(values)> rest(values.begin() + first_vertex, values.end());
      values.resize(first_vertex);
      return rest;
    };
    const auto positions = tail(mesh_.positions);
    const auto texcoords = tail(mesh_.texcoords);
    const auto colors = tail(mesh_.colors);
    for (std::size_t i = first_triangle; i < mesh_.triangles.size(); ++i) {
      auto& triangle = mesh_.triangles[i];
      for (int corner = 0; corner < 3; ++corner) {
        const std::uint32_t old = triangle[corner] - first_vertex;
        triangle[corner] = static_cast<std::uint32_t>(mesh_.positions.size());
        mesh_.positions.push_back(positions[old]);
        mesh_.texcoords.push_back(texcoords[old]);
        mesh_.colors.push_back(colors[old]);
      }
      const auto& p = mesh_.positions;
      const Eigen::Vector3f across =
          (p[triangle[1]] - p[triangle[0]]).cross(p[triangle[2]] - p[triangle[0]]);
      const Eigen::Vector3f normal = across.stableNormalized();
      mesh_.normals.insert(mesh_.normals.end(), 3,
                           normal.squaredNorm() > 0.5f ? normal : Eigen::Vector3f::UnitY());
    }
  }

  void DropUnusedAttributes() {
    if (!has_texcoords_) mesh_.texcoords.clear();
    if (!has_colors_) mesh_.colors.clear();
  }

  BadFile Bad(const std::string& problem) const {
    return {path_.string(), problem, "repair or export the file again"};
  }

  const aiScene& scene_;
  const fs::path& path_;
  const bool linear_colors_;
  Mesh mesh_;
  std::vector<unsigned> texcoord_sets_;  // one a material
  bool has_texcoords_ = false;
  bool has_colors_ = false;
};

}  // namespace

Mesh LoadMesh(const std::filesystem::path& path) {
  RequireFile(path);
  Assimp::Importer importer;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE,
                              aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = importer.ReadFile(path.string(), kPostProcessing);
  if (!scene || !scene->mRootNode) {
    throw BadFile(path.string(),
                  "cannot be read as a mesh (" + Quoted(importer.GetErrorString()) + ")",
                  kHowToGiveAMesh);
  }
  Mesh mesh = SceneReader(*scene, path).Read();
  if (mesh.triangles.empty()) {
    throw BadFile(path.string(), "has no triangles", kHowToGiveAMesh);
  }
  return mesh;
}

}  // namespace antipode

#endif
