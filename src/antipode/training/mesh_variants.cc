#include "antipode/training/mesh_variants.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "antipode/util/seeds.h"

namespace antipode {
namespace {

Eigen::Vector3f UniformVector(std::mt19937_64& random, double low, double high) {
  const double x = UniformIn(random, low, high), y = UniformIn(random, low, high), z = UniformIn(random, low, high);
  return Eigen::Vector3d(x, y, z).cast<float>();
}

/// No vertex is shared between triangles, so that each may carry its own texture coordinates.
Mesh WithSeparateTriangles(const Mesh& mesh) {
  Mesh result;
  result.materials = mesh.materials;
  result.triangle_materials = mesh.triangle_materials;
  for (const auto& triangle : mesh.triangles) {
    const auto first = static_cast<std::uint32_t>(result.positions.size());
    result.triangles.emplace_back(first, first + 1, first + 2);
    for (const std::uint32_t vertex : triangle) {
      result.positions.push_back(mesh.positions[vertex]);
      result.normals.push_back(mesh.normals[vertex]);
    }
  }
  return result;
}

/// @param repeats copies of the texture across the unit sphere's diameter
void ProjectTexcoords(Mesh& mesh, double repeats, const Eigen::Vector2f& offset) {
  mesh.texcoords.resize(mesh.positions.size());
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.positions[triangle[0]];
    const Eigen::Vector3f facing = (mesh.positions[triangle[1]] - a).cross(mesh.positions[triangle[2]] - a);
    int axis = 0;
    facing.cwiseAbs().maxCoeff(&axis);
    for (const std::uint32_t vertex : triangle) {
      const Eigen::Vector3f& position = mesh.positions[vertex];
      const Eigen::Vector2f plane(position[axis == 0 ? 2 : 0], -position[axis == 1 ? 2 : 1]);
      mesh.texcoords[vertex] = plane * static_cast<float>(repeats / 2) + offset;
    }
  }
}

/// Gives `mesh` values for every vertex where only one of two joined meshes has them.
template <typename Vector>
void Fill(std::vector<Vector>& values, std::size_t count, bool needed, const Vector& value) {
  if (needed) values.resize(count, value);
}

void Append(Mesh& mesh, Mesh other) {
  const bool textured = !mesh.texcoords.empty() || !other.texcoords.empty();
  const bool colored = !mesh.colors.empty() || !other.colors.empty();
  for (Mesh* part : {&mesh, &other}) {
    Fill(part->texcoords, part->positions.size(), textured, Eigen::Vector2f(Eigen::Vector2f::Zero()));
    Fill(part->colors, part->positions.size(), colored, Eigen::Vector3f(Eigen::Vector3f::Ones()));
  }
  const auto vertices = static_cast<std::uint32_t>(mesh.positions.size());
  const auto materials = static_cast<std::uint16_t>(mesh.materials.size());
  for (auto& triangle : other.triangles) triangle.array() += vertices;
  for (auto& material : other.triangle_materials) material = static_cast<std::uint16_t>(material + materials);
  const auto append = [](auto& target, const auto& source) {
    target.insert(target.end(), source.begin(), source.end());
  };
  append(mesh.positions, other.positions);
  append(mesh.normals, other.normals);
  append(mesh.texcoords, other.texcoords);
  append(mesh.colors, other.colors);
  append(mesh.triangles, other.triangles);
  append(mesh.triangle_materials, other.triangle_materials);
  append(mesh.materials, other.materials);
}

}  // namespace

Mesh RandomlyStretched(const Mesh& mesh, double greatest, std::mt19937_64& random) {
  const double half = std::log(greatest) / 2;
  return Scaled(mesh, UniformVector(random, -half, half).array().exp().matrix());
}

Mesh RandomlyRetextured(const Mesh& mesh, const Mesh& donor, std::mt19937_64& random) {
  Mesh result = WithSeparateTriangles(mesh);
  const double repeats = std::exp(UniformIn(random, std::log(0.5), std::log(3.0)));
  ProjectTexcoords(result, repeats, UniformVector(random, 0, 1).head<2>());
  const Material& source = donor.materials[UniformIndex(random, donor.materials.size())];
  for (Material& material : result.materials) {
    const bool textured = UniformIn(random, 0, 1) < 0.5 && !source.texture.empty();
    material.texture = textured ? source.texture : cv::Mat();
    material.base_color = textured ? UniformVector(random, 0.5, 1) : UniformVector(random, 0.02, 0.9);
  }
  return result;
}

Mesh RandomlyJoined(const Mesh& mesh, const Mesh& other, std::mt19937_64& random) {
  const auto scale = static_cast<float>(UniformIn(random, 0.4, 0.9));
  const Eigen::Matrix3f turn =
      Eigen::AngleAxisf(static_cast<float>(UniformIn(random, -std::numbers::pi, std::numbers::pi)), Eigen::Vector3f::UnitY())
          .toRotationMatrix();
  const Eigen::Vector3f direction = UniformVector(random, -1, 1).normalized();
  const Eigen::Vector3f shift = direction * static_cast<float>(UniformIn(random, 0.3, 0.9)) * (1 + scale);
  Mesh part = other;
  for (auto& position : part.positions) position = turn * position * scale + shift;
  for (auto& normal : part.normals) normal = turn * normal;
  Mesh joined = mesh;
  Append(joined, std::move(part));
  joined.Normalize();
  return joined;
}

Mesh RandomVariant(int kind, const Mesh& mesh, const std::function<Mesh()>& load_donor, double greatest_stretch, std::mt19937_64& random) {
  if (kind == 0) return mesh;
  const Mesh stretched = RandomlyStretched(mesh, greatest_stretch, random);
  switch ((kind - 1) % 3) {
    case 0: return stretched;
    case 1: return RandomlyRetextured(stretched, load_donor(), random);
    default: return RandomlyJoined(stretched, load_donor(), random);
  }
}

}  // namespace antipode
