#include "antipode/training/mesh_variants.h"

#include <gtest/gtest.h>

#include "antipode/render/test_meshes.h"

namespace antipode {
namespace {

constexpr int kSeeds = 20;

Mesh Textured(Mesh mesh) {
  for (Material& material : mesh.materials) material.texture = cv::Mat(4, 4, CV_8UC3, cv::Scalar(10, 200, 30));
  return mesh;
}

/// Normals point to the side that the triangles' winding says is outside.
int TrianglesFacingTheirNormals(const Mesh& mesh) {
  int count = 0;
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3f a = mesh.positions[triangle[0]], b = mesh.positions[triangle[1]], c = mesh.positions[triangle[2]];
    count += (b - a).cross(c - a).dot(mesh.normals[triangle[0]]) > 0;
  }
  return count;
}

TEST(MeshVariants, AreValidMeshesInTheUnitSphere) {
  const Mesh cube = MakeBox({0.4f, 0.5f, 0.6f}), donor = Textured(MakeBox({0.4f, 0.5f, 0.6f}));
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(seed);
    for (const Mesh& variant : {RandomlyStretched(cube, 1.35, random), RandomlyRetextured(cube, donor, random),
                                RandomlyJoined(cube, donor, random), RandomlyJoined(donor, cube, random)}) {
      EXPECT_NO_THROW(variant.Check());
      EXPECT_LE(variant.Radius(), 1 + 1e-4f);
    }
  }
}

TEST(MeshVariants, SameSeedGivesTheSameMeshAndAnotherSeedAnother) {
  const Mesh cube = MakeBox({0.4f, 0.5f, 0.6f});
  std::mt19937_64 one(1), again(1), other(2);
  const auto first = RandomlyJoined(cube, cube, one).positions;
  EXPECT_EQ(first, RandomlyJoined(cube, cube, again).positions);
  EXPECT_NE(first, RandomlyJoined(cube, cube, other).positions);
}

TEST(MeshVariants, RetexturingKeepsTheShape) {
  const Mesh cube = MakeBox({0.4f, 0.5f, 0.6f});
  std::mt19937_64 random(3);
  const Mesh variant = RandomlyRetextured(cube, Textured(cube), random);
  ASSERT_EQ(variant.triangles.size(), cube.triangles.size());
  for (std::size_t i = 0; i < cube.triangles.size(); ++i)
    for (int corner = 0; corner < 3; ++corner)
      EXPECT_EQ(variant.positions[variant.triangles[i][corner]], cube.positions[cube.triangles[i][corner]]);
}

TEST(MeshVariants, RetexturingUsesTheDonorsTextureAboutHalfOfTheTime) {
  const Mesh cube = MakeBox({0.4f, 0.5f, 0.6f}), donor = Textured(cube);
  int textured = 0;
  for (int seed = 0; seed < 100; ++seed) {
    std::mt19937_64 random(seed);
    textured += !RandomlyRetextured(cube, donor, random).materials.front().texture.empty();
  }
  EXPECT_GT(textured, 30);
  EXPECT_LT(textured, 70);
}

TEST(MeshVariants, JoiningKeepsAllTrianglesAndTheirOutsides) {
  const Mesh cube = MakeBox({0.4f, 0.5f, 0.6f});
  std::mt19937_64 random(4);
  const Mesh joined = RandomlyJoined(cube, Textured(cube), random);
  EXPECT_EQ(joined.triangles.size(), 2 * cube.triangles.size());
  EXPECT_EQ(joined.materials.size(), 2 * cube.materials.size());
  EXPECT_EQ(joined.texcoords.size(), joined.positions.size());
  EXPECT_EQ(TrianglesFacingTheirNormals(joined), 2 * TrianglesFacingTheirNormals(cube));
}

}  // namespace
}  // namespace antipode
