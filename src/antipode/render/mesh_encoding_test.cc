#include "antipode/render/mesh_encoding.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "antipode/render/test_meshes.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

constexpr int kSeeds = 20;

cv::Mat NoTexture(std::uint32_t) { return {}; }

std::vector<std::byte> Encoded(const Mesh& mesh) {
  return EncodeMesh(mesh, std::vector<std::uint32_t>(mesh.materials.size(), kNoTexture));
}

Mesh RoundTrip(const Mesh& mesh) { return DecodeMesh(Encoded(mesh), NoTexture); }

Eigen::Vector3f RandomVector(std::mt19937_64& random, double low, double high) {
  const double x = UniformIn(random, low, high), y = UniformIn(random, low, high), z = UniformIn(random, low, high);
  return Eigen::Vector3d(x, y, z).cast<float>();
}

/// Triangles between any vertices, with all attributes.
Mesh RandomMesh(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Mesh mesh;
  for (int i = 0; i < 3; ++i) mesh.materials.push_back({RandomVector(random, 0, 1), {}});
  const std::size_t vertices = 3 + UniformIndex(random, 200);
  for (std::size_t i = 0; i < vertices; ++i) {
    mesh.positions.push_back(RandomVector(random, -1, 1).cwiseProduct(Eigen::Vector3f(1, 0.1f, 3)));
    mesh.normals.push_back(RandomVector(random, -1, 1).normalized());
    mesh.texcoords.push_back(RandomVector(random, -2, 5).head<2>());
    mesh.colors.push_back(RandomVector(random, 0, 1));
  }
  const std::size_t triangles = 1 + UniformIndex(random, 300);
  for (std::size_t i = 0; i < triangles; ++i) {
    const auto vertex = [&] { return static_cast<std::uint32_t>(UniformIndex(random, vertices)); };
    const std::uint32_t a = vertex(), b = vertex(), c = vertex();
    mesh.triangles.emplace_back(a, b, c);
    mesh.triangle_materials.push_back(static_cast<std::uint16_t>(UniformIndex(random, 3)));
  }
  return mesh;
}

float AngleDeg(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi_v<float>;
}

TEST(EncodeMesh, RoundTripIsWithinHalfAStep) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    const Mesh mesh = RandomMesh(seed), decoded = RoundTrip(mesh);
    ASSERT_EQ(decoded.positions.size(), mesh.positions.size());
    const float step = 6.f / 65535;  // of a box of side 6 at most
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      EXPECT_LT((decoded.positions[i] - mesh.positions[i]).cwiseAbs().maxCoeff(), 0.51f * step);
      EXPECT_LT((decoded.texcoords[i] - mesh.texcoords[i]).cwiseAbs().maxCoeff(), 0.51f * 7 / 65535);
      EXPECT_LT(AngleDeg(decoded.normals[i], mesh.normals[i]), 0.25f);
      EXPECT_LT((decoded.colors[i] - mesh.colors[i]).cwiseAbs().maxCoeff(), 0.005f);
    }
  }
}

TEST(EncodeMesh, KeepsTrianglesAndMaterials) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    const Mesh mesh = RandomMesh(seed), decoded = RoundTrip(mesh);
    EXPECT_EQ(decoded.triangles, mesh.triangles);
    EXPECT_EQ(decoded.triangle_materials, mesh.triangle_materials);
    for (std::size_t i = 0; i < mesh.materials.size(); ++i)
      EXPECT_EQ(decoded.materials.at(i).base_color, mesh.materials[i].base_color);
  }
}

TEST(EncodeMesh, KeepsMoreVerticesThanSixteenBitsCount) {
  const Mesh mesh = MakeSphere(1, 200), decoded = RoundTrip(mesh);
  ASSERT_GT(mesh.positions.size(), 65536u);
  EXPECT_EQ(decoded.triangles, mesh.triangles);
  EXPECT_TRUE(decoded.texcoords.empty() && decoded.colors.empty());
}

TEST(EncodeMesh, KeepsNormalsAlongTheAxesAndTheFlatSideOfABox) {
  const Mesh box = MakeBox({0.4f, 0.5f, 0}), decoded = RoundTrip(box);
  for (std::size_t i = 0; i < box.normals.size(); ++i) {
    EXPECT_EQ(decoded.positions[i].z(), 0);
    EXPECT_LT(AngleDeg(decoded.normals[i], box.normals[i]), 1e-4f);
  }
}

TEST(EncodeMesh, KeepsDarkTonesAndColoursBrighterThanWhite) {
  Mesh mesh = MakeBox({0.4f, 0.5f, 0.6f});
  mesh.colors.assign(mesh.positions.size(), {0.002f, 0.01f, 0.2f});
  for (int channel = 0; channel < 3; ++channel)
    EXPECT_NEAR(RoundTrip(mesh).colors[0][channel] / mesh.colors[0][channel], 1, 0.08f);
  mesh.colors[1] = {3, 1.5f, 0};
  EXPECT_LT((RoundTrip(mesh).colors[1] - mesh.colors[1]).cwiseAbs().maxCoeff(), 0.02f);
}

TEST(EncodeMesh, GivesEveryMaterialItsTexture) {
  const Mesh box = MakeBox({0.4f, 0.5f, 0.6f});
  const std::vector<std::uint32_t> textures{7, kNoTexture, 7, 0, kNoTexture, 3};
  const auto picture = [](std::uint32_t number) { return cv::Mat(1, static_cast<int>(number) + 1, CV_8UC3); };
  const Mesh decoded = DecodeMesh(EncodeMesh(box, textures), picture);
  for (std::size_t i = 0; i < textures.size(); ++i)
    EXPECT_EQ(decoded.materials[i].texture.cols, textures[i] == kNoTexture ? 0 : static_cast<int>(textures[i]) + 1);
  EXPECT_THROW(EncodeMesh(box, std::vector<std::uint32_t>{1}), Error);
}

TEST(DecodeMesh, RefusesAnotherLength) {
  std::vector<std::byte> bytes = Encoded(RandomMesh(1));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(DecodeMesh(std::span(bytes).first(size), NoTexture), Error) << size;
  bytes.push_back({});
  EXPECT_THROW(DecodeMesh(bytes, NoTexture), Error);
}

TEST(DecodeMesh, DamageGivesAnErrorOrASoundMesh) {
  const std::vector<std::byte> whole = Encoded(RandomMesh(2));
  std::mt19937_64 random(3);
  int refused = 0;
  for (int i = 0; i < 2000; ++i) {
    std::vector<std::byte> damaged = whole;
    damaged[UniformIndex(random, i % 2 ? damaged.size() : 100)] = static_cast<std::byte>(random());
    try {
      DecodeMesh(damaged, NoTexture).Check();
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace antipode
