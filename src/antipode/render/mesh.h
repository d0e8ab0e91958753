#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace antipode {

/// Surface appearance of a part of a mesh: base colour only (metallic 0, roughness 1,
/// double-sided).
struct Material {
  Eigen::Vector3f base_color = Eigen::Vector3f::Ones();  ///< linear RGB factor, 0..1
  /// 8UC3, RGB, sRGB-encoded, REPEAT wrapping; may be empty. Multiplies `base_color`.
  cv::Mat texture;
};

/// A triangle mesh in the object frame (right-handed, +Y up, inside the unit sphere).
struct Mesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< unit, one a vertex
  /// One a vertex, or empty. As in glTF: (0, 0) is the top-left corner of the texture, v points
  /// down.
  std::vector<Eigen::Vector2f> texcoords;
  std::vector<Eigen::Vector3f> colors;  ///< linear RGB, one a vertex, or empty (white)
  std::vector<Eigen::Matrix<std::uint32_t, 3, 1>> triangles;
  std::vector<std::uint16_t> triangle_materials;  ///< index into `materials`, one a triangle
  std::vector<Material> materials;                ///< at least one

  /// Radius of the sphere about the origin that holds every vertex.
  float Radius() const;

  /// Moves the centre of the smallest enclosing sphere to the origin and scales the mesh to
  /// radius 1. A mesh without extent is only moved.
  void Normalize();

  /// @throws Error if there is no vertex, triangle or material, a size or an index does not fit, a
  ///   value is not finite or a texture is not 8UC3
  void Check() const;
};

/// Reads a binary or text glTF file (also anything else assimp reads), all nodes merged with their
/// transforms, polygons cut into triangles, points and lines left out. Primitives without normals
/// get the flat ones of their triangles, as glTF asks. Colours of formats other than glTF are taken
/// as sRGB. Neither centred nor scaled: see Mesh::Normalize.
/// @throws BadFile naming the file (or a texture file beside it) if it is missing, a folder, empty,
///   cut short, not a mesh or has no triangles
Mesh LoadMesh(const std::filesystem::path& path);

/// The mirror image: x negated, winding of the triangles turned so that outsides stay outside.
Mesh MirroredX(const Mesh& mesh);

/// The mesh stretched along its axes, normals by the inverse transpose, then Normalize()d.
/// @throws InvalidOption if a factor is not positive and finite
Mesh Scaled(const Mesh& mesh, const Eigen::Vector3f& factors);

}  // namespace antipode
