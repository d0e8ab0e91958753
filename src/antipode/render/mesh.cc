#include "antipode/render/mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "antipode/render/enclosing_sphere.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

template <typename Vectors>
bool AllFinite(const Vectors& vectors) {
  return std::all_of(vectors.begin(), vectors.end(), [](const auto& v) { return v.allFinite(); });
}

void Require(bool condition, const std::string& problem) {
  if (!condition) throw Error("mesh", problem);
}

void TurnWinding(Mesh& mesh) {
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
}

}  // namespace

float Mesh::Radius() const {
  float largest = 0;
  for (const Eigen::Vector3f& position : positions) {
    largest = std::max(largest, position.squaredNorm());
  }
  return std::sqrt(largest);
}

void Mesh::Normalize() {
  const Sphere sphere = SmallestEnclosingSphere(positions);
  const double scale = sphere.radius > 0 ? 1 / sphere.radius : 1;
  for (Eigen::Vector3f& position : positions) {
    position = ((position.cast<double>() - sphere.centre) * scale).cast<float>();
  }
}

void Mesh::Check() const {
  const std::size_t count = positions.size();
  Require(count > 0 && count < std::numeric_limits<std::uint32_t>::max(),
          "has no vertices or too many");
  Require(!triangles.empty(), "has no triangles");
  Require(!materials.empty() && materials.size() <= 65536, "has no material or more than 65536");
  Require(normals.size() == count, "must have one normal a vertex");
  Require(texcoords.empty() || texcoords.size() == count,
          "must have one texture coordinate a vertex, or none");
  Require(colors.empty() || colors.size() == count, "must have one colour a vertex, or none");
  Require(triangle_materials.size() == triangles.size(), "must have one material a triangle");
  Require(AllFinite(positions) && AllFinite(normals) && AllFinite(texcoords) && AllFinite(colors),
          "has a coordinate or colour that is not finite");
  for (const auto& triangle : triangles) {
    Require(triangle.maxCoeff() < count, "has a triangle that refers to a missing vertex");
  }
  for (const std::uint16_t material : triangle_materials) {
    Require(material < materials.size(), "has a triangle that refers to a missing material");
  }
  for (const Material& material : materials) {
    Require(material.base_color.allFinite(), "has a base colour that is not finite");
    Require(material.texture.empty() || material.texture.type() == CV_8UC3,
            "has a texture that is not 8-bit RGB");
  }
}

Mesh MirroredX(const Mesh& mesh) {
  Mesh mirrored = mesh;
  for (Eigen::Vector3f& position : mirrored.positions) position.x() = -position.x();
  for (Eigen::Vector3f& normal : mirrored.normals) normal.x() = -normal.x();
  TurnWinding(mirrored);
  return mirrored;
}

Mesh Scaled(const Mesh& mesh, const Eigen::Vector3f& factors) {
  if (!factors.allFinite() || factors.minCoeff() <= 0) {
    throw InvalidOption("factors", "must be positive and finite");
  }
  Mesh scaled = mesh;
  for (Eigen::Vector3f& position : scaled.positions) position = position.cwiseProduct(factors);
  for (Eigen::Vector3f& normal : scaled.normals) {
    normal = normal.cwiseQuotient(factors).normalized();
  }
  scaled.Normalize();
  return scaled;
}

}  // namespace antipode
