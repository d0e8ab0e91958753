#include "antipode/render/mesh.h"

#include <cstring>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "antipode/render/test_meshes.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

template <typename Value>
void Append(const std::vector<Value>& values, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value));
}

std::string EncodedPicture(const cv::Mat& rgb, const std::string& extension) {
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<unsigned char> bytes;
  cv::imencode(extension, bgr, bytes, {cv::IMWRITE_JPEG_QUALITY, 100});
  return {bytes.begin(), bytes.end()};
}

void PadTo4(std::string& bytes, char filler) {
  while (bytes.size() % 4 != 0) bytes += filler;
}

/// The quad [-1, 1] x [-1, 1] at z = 0, facing +Z, FourColors upright on it, in one buffer:
/// positions at 0, texture coordinates at 48, indices at 80, colours at 92, the picture at 140.
std::string QuadBuffer(const std::string& picture) {
  std::string buffer;
  Append<float>({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, buffer);
  Append<float>({0, 1, 1, 1, 1, 0, 0, 0}, buffer);
  Append<std::uint16_t>({0, 1, 2, 0, 2, 3}, buffer);
  Append<float>({1, 0.5, 0.25, 1, 0.5, 0.25, 1, 0.5, 0.25, 1, 0.5, 0.25}, buffer);
  buffer += picture;
  return buffer;
}

/// @param node members of the only node beside its mesh, `buffer` and `image` members of theirs
std::string QuadJson(const std::string& node, const std::string& buffer, const std::string& image,
                     std::size_t picture_size) {
  const std::string picture = std::to_string(picture_size);
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0)" +
         node + R"(}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1,)" +
         R"("COLOR_0":3},"indices":2,"material":0}]}],"materials":[{"pbrMetallicRoughness":)" +
         R"({"baseColorTexture":{"index":0},"baseColorFactor":[0.5,1,0.75,1]}}],)" +
         R"("textures":[{"source":0}],"images":[{)" + image + R"(}],"accessors":[)" +
         R"({"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[-1,-1,0],)" +
         R"("max":[1,1,0]},{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},)" +
         R"({"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"},)" +
         R"({"bufferView":3,"componentType":5126,"count":4,"type":"VEC3"}],"bufferViews":[)" +
         R"({"buffer":0,"byteOffset":0,"byteLength":48},{"buffer":0,"byteOffset":48,)" +
         R"("byteLength":32},{"buffer":0,"byteOffset":80,"byteLength":12},)" +
         R"({"buffer":0,"byteOffset":92,"byteLength":48})" +
         (picture_size > 0 ? R"(,{"buffer":0,"byteOffset":140,"byteLength":)" + picture + "}"
                           : "") +
         R"(],"buffers":[{)" + buffer + "}]}";
}

std::string QuadGlb(const std::string& node = {}, const std::string& extension = ".jpg") {
  const std::string picture = EncodedPicture(FourColors(64), extension);
  const std::string type = extension == ".jpg" ? "jpeg" : "png";
  std::string buffer = QuadBuffer(picture);
  std::string json = QuadJson(node, R"("byteLength":)" + std::to_string(buffer.size()),
                              R"("bufferView":4,"mimeType":"image/)" + type + "\"", picture.size());
  PadTo4(json, ' ');
  PadTo4(buffer, '\0');
  std::string glb = "glTF";
  Append<std::uint32_t>({2, static_cast<std::uint32_t>(28 + json.size() + buffer.size()),
                         static_cast<std::uint32_t>(json.size()), 0x4E4F534A},
                        glb);
  glb += json;
  Append<std::uint32_t>({static_cast<std::uint32_t>(buffer.size()), 0x004E4942}, glb);
  return glb + buffer;
}

fs::path Written(const TemporaryFolder& folder, const std::string& name,
                 const std::string& content) {
  const fs::path path = folder.path() / name;
  std::ofstream(path, std::ios::binary) << content;
  return path;
}

/// The texel that a texture coordinate falls on.
cv::Vec3b TexelAt(const cv::Mat& texture, const Eigen::Vector2f& texcoord) {
  const int i = std::min(static_cast<int>(texcoord.y() * texture.rows), texture.rows - 1);
  const int j = std::min(static_cast<int>(texcoord.x() * texture.cols), texture.cols - 1);
  return texture.at<cv::Vec3b>(i, j);
}

double ColorDistance(const cv::Vec3b& a, const cv::Vec3b& b) {
  return cv::norm(cv::Vec3d(a) - cv::Vec3d(b));
}

/// Red is at the top left of the quad as its front is seen, and so on.
void ExpectFourColorsInPlace(const Mesh& mesh) {
  ASSERT_EQ(mesh.texcoords.size(), mesh.positions.size());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const bool left = mesh.positions[i].x()<0, top = mesh.positions[i].y()> 0;
    const cv::Vec3b expected = top ? (left ? kRed : kGreen) : (left ? kBlue : kYellow);
    const cv::Vec3b found =
        TexelAt(mesh.materials[mesh.triangle_materials[0]].texture, mesh.texcoords[i]);
    EXPECT_LT(ColorDistance(found, expected), 12) << "vertex " << i;
  }
}

Eigen::Vector3f FaceNormal(const Mesh& mesh, std::size_t triangle) {
  const auto& corners = mesh.triangles[triangle];
  const auto& p = mesh.positions;
  return (p[corners[1]] - p[corners[0]]).cross(p[corners[2]] - p[corners[0]]).normalized();
}

std::string MessageOf(const fs::path& path) {
  try {
    LoadMesh(path);
  } catch (const BadFile& error) {
    return error.what();
  }
  return "no BadFile";
}

TEST(LoadMesh, BinaryGltfKeepsTextureOrientationFactorsAndColors) {
  const TemporaryFolder folder;
  for (const std::string extension : {".jpg", ".png"}) {
    const Mesh mesh = LoadMesh(Written(folder, "quad.glb", QuadGlb({}, extension)));
    ASSERT_EQ(mesh.triangles.size(), 2u);
    ExpectFourColorsInPlace(mesh);
    const Material& material = mesh.materials[mesh.triangle_materials[0]];
    EXPECT_LT((material.base_color - Eigen::Vector3f(0.5f, 1, 0.75f)).norm(), 1e-6f);
    ASSERT_EQ(mesh.colors.size(), mesh.positions.size());
    for (const auto& color : mesh.colors) {
      EXPECT_LT((color - Eigen::Vector3f(1, 0.5f, 0.25f)).norm(), 1e-6f);
    }
    for (const auto& normal : mesh.normals) {
      EXPECT_LT((normal - Eigen::Vector3f::UnitZ()).norm(), 1e-6f);
    }
    EXPECT_NO_THROW(mesh.Check());
  }
}

TEST(LoadMesh, TextGltfWithSeparateFilesAndASpaceInTheirNames) {
  const TemporaryFolder folder;
  Written(folder, "the picture.png", EncodedPicture(FourColors(16), ".png"));
  const std::string buffer = QuadBuffer({});
  Written(folder, "quad.bin", buffer);
  const std::string json =
      QuadJson({}, R"("uri":"quad.bin","byteLength":)" + std::to_string(buffer.size()),
               R"("uri":"the%20picture.png")", 0);
  const fs::path path = Written(folder, "quad.gltf", json);
  ExpectFourColorsInPlace(LoadMesh(path));
  fs::remove(folder.path() / "the picture.png");
  EXPECT_NE(MessageOf(path).find("the picture.png"), std::string::npos) << MessageOf(path);
}

TEST(LoadMesh, ObjHasTheSameTextureOrientation) {
  const TemporaryFolder folder;
  Written(folder, "four.png", EncodedPicture(FourColors(16), ".png"));
  Written(folder, "quad.mtl", "newmtl m\nKd 1 1 1\nmap_Kd four.png\n");
  const fs::path path = Written(folder, "quad.obj",
                                "mtllib quad.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
                                "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n");
  const Mesh mesh = LoadMesh(path);
  EXPECT_EQ(mesh.triangles.size(), 2u);
  ExpectFourColorsInPlace(mesh);
}

TEST(LoadMesh, AppliesTheTransformOfTheNode) {
  const TemporaryFolder folder;
  // Column by column: x -> 2y, y -> -x, z -> z, then (5, 6, 7).
  const Mesh mesh = LoadMesh(
      Written(folder, "quad.glb", QuadGlb(R"(,"matrix":[0,2,0,0,-1,0,0,0,0,0,1,0,5,6,7,1])")));
  for (const auto& position : mesh.positions) {
    EXPECT_NEAR(std::abs(position.x() - 5), 1, 1e-6);
    EXPECT_NEAR(std::abs(position.y() - 6), 2, 1e-6);
    EXPECT_NEAR(position.z(), 7, 1e-6);
  }
}

TEST(LoadMesh, MirroringNodeKeepsTheOutsideOutside) {
  const TemporaryFolder folder;
  const Mesh mesh = LoadMesh(Written(folder, "quad.glb", QuadGlb(R"(,"scale":[-1,1,3])")));
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    EXPECT_GT(FaceNormal(mesh, i).z(), 0.99f);
    EXPECT_GT(mesh.normals[mesh.triangles[i][0]].z(), 0.99f);
  }
}

TEST(LoadMesh, KeepsGivenNormals) {
  const TemporaryFolder folder;
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 -1\nvn 0 1 2\nf 1//1 2//1 3//1\n";
  const Mesh mesh = LoadMesh(Written(folder, "t.obj", obj));
  ASSERT_EQ(mesh.triangles.size(), 1u);
  EXPECT_TRUE(mesh.texcoords.empty());
  EXPECT_TRUE(mesh.colors.empty());
  for (const auto& normal : mesh.normals) {
    EXPECT_LT((normal - Eigen::Vector3f(0, 1, 2).normalized()).norm(), 1e-6f);
  }
}

TEST(LoadMesh, TransformsGivenNormalsByTheInverseTranspose) {
  const TemporaryFolder folder;
  Written(folder, "four.png", EncodedPicture(FourColors(16), ".png"));
  const std::string buffer = QuadBuffer({});
  Written(folder, "quad.bin", buffer);
  std::string json = QuadJson(R"(,"scale":[-1,2,4])",
                              R"("uri":"quad.bin","byteLength":)" + std::to_string(buffer.size()),
                              R"("uri":"four.png")", 0);
  const std::string colors = "COLOR_0";
  json.replace(json.find(colors), colors.size(), "NORMAL");
  const Mesh mesh = LoadMesh(Written(folder, "quad.gltf", json));
  for (const auto& normal : mesh.normals) {
    const Eigen::Vector3f expected(1.f / -1, 0.5f / 2, 0.25f / 4);
    EXPECT_LT((normal - expected.normalized()).norm(), 1e-6f);
  }
}

TEST(LoadMesh, NamesTheFileInEveryError) {
  const TemporaryFolder folder;
  fs::create_directory(folder.path() / "folder.glb");
  Written(folder, "empty.glb", "");
  Written(folder, "notes.txt", "this is not a mesh");
  Written(folder, "notes.glb", "this is not a mesh");
  Written(folder, "points.obj", "v 0 0 0\nv 1 0 0\n");
  Written(folder, "line.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n");
  Written(folder, "nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  Written(folder, "bad picture.glb", [] {
    std::string glb = QuadGlb();
    std::fill(glb.begin() + static_cast<long>(glb.find("\xff\xd8\xff")), glb.end(), 'x');
    return glb;
  }());
  for (const std::string name : {"missing.glb", "folder.glb", "empty.glb", "notes.txt", "notes.glb",
                                 "points.obj", "line.obj", "nan.obj", "bad picture.glb"}) {
    const std::string message = MessageOf(folder.path() / name);
    EXPECT_NE(message.find((folder.path() / name).string()), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

TEST(LoadMesh, TruncatedFileIsRefusedWhereverItIsCut) {
  const TemporaryFolder folder;
  const std::string whole = QuadGlb();
  for (std::size_t size = 1; size < whole.size(); size += size < 200 ? 7 : 61) {
    const std::string message = MessageOf(Written(folder, "cut.glb", whole.substr(0, size)));
    EXPECT_NE(message.find("cut.glb"), std::string::npos) << size << " bytes: " << message;
  }
}

TEST(LoadMesh, DamagedFileNeverCrashes) {
  const TemporaryFolder folder;
  const std::string whole = QuadGlb();
  std::mt19937 generator(11);
  for (int i = 0; i < 300; ++i) {
    std::string damaged = whole;
    for (int j = 0; j < 4; ++j) {
      damaged[generator() % std::min<std::size_t>(damaged.size(), 1600)] =
          static_cast<char>(generator());
    }
    try {
      LoadMesh(Written(folder, "damaged.glb", damaged)).Check();
    } catch (const BadFile& error) {
      EXPECT_NE(std::string(error.what()).find("glb"), std::string::npos) << error.what();
    }
  }
}

TEST(Mesh, NormalizeGivesRadiusOneAndUndoesMovesAndScales) {
  std::mt19937 generator(5);
  std::uniform_real_distribution<float> value(-2, 2);
  for (int i = 0; i < 30; ++i) {
    Mesh mesh = MakeBox({0.3f, 0.5f, 0.2f});
    for (auto& position : mesh.positions) {
      position += 0.2f * Eigen::Vector3f(value(generator), value(generator), value(generator));
    }
    Mesh moved = mesh;
    const Eigen::Vector3f shift(value(generator), value(generator), value(generator));
    const float scale = std::exp(value(generator));
    for (auto& position : moved.positions) position = scale * position + shift;
    mesh.Normalize();
    moved.Normalize();
    EXPECT_NEAR(mesh.Radius(), 1, 1e-6);
    for (std::size_t j = 0; j < mesh.positions.size(); ++j) {
      EXPECT_LT((mesh.positions[j] - moved.positions[j]).norm(), 2e-5f);
    }
  }
}

TEST(Mesh, CheckFindsEveryDefect) {
  const auto expect_defect = [](const auto& spoil) {
    Mesh mesh = MakeBox({1, 1, 1});
    EXPECT_NO_THROW(mesh.Check());
    spoil(mesh);
    EXPECT_THROW(mesh.Check(), Error);
  };
  expect_defect([](Mesh& mesh) { mesh.triangles.clear(); });
  expect_defect([](Mesh& mesh) { mesh.materials.clear(); });
  expect_defect([](Mesh& mesh) { mesh.normals.pop_back(); });
  expect_defect([](Mesh& mesh) { mesh.texcoords.pop_back(); });
  expect_defect([](Mesh& mesh) { mesh.colors.resize(1); });
  expect_defect([](Mesh& mesh) { mesh.triangle_materials.pop_back(); });
  expect_defect([](Mesh& mesh) { mesh.triangle_materials[0] = 6; });
  expect_defect([](Mesh& mesh) { mesh.triangles[3][1] = 24; });
  expect_defect([](Mesh& mesh) { mesh.positions[2].y() = NAN; });
  expect_defect([](Mesh& mesh) { mesh.texcoords[2].y() = INFINITY; });
  expect_defect([](Mesh& mesh) { mesh.materials[1].texture = cv::Mat(2, 2, CV_8UC1); });
}

TEST(MirroredX, TwiceIsTheMeshAndOnceTurnsEveryNormalAlong) {
  const Mesh mesh = Scaled(MakeSphere(1, 12), {1, 2, 0.5f});
  const Mesh once = MirroredX(mesh);
  const Mesh twice = MirroredX(once);
  EXPECT_EQ(twice.positions, mesh.positions);
  EXPECT_EQ(twice.normals, mesh.normals);
  EXPECT_EQ(twice.triangles, mesh.triangles);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Eigen::Vector3f expected = FaceNormal(mesh, i).cwiseProduct(Eigen::Vector3f(-1, 1, 1));
    EXPECT_LT((FaceNormal(once, i) - expected).norm(), 1e-5f);
  }
}

TEST(Scaled, NormalsStayAcrossTheSurfaceAndFactorsCompose) {
  std::mt19937 generator(6);
  std::uniform_real_distribution<float> factor(0.4f, 2.5f);
  const Mesh sphere = MakeSphere(1, 48);
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector3f a(factor(generator), factor(generator), factor(generator));
    const Eigen::Vector3f b(factor(generator), factor(generator), factor(generator));
    const Mesh ellipsoid = Scaled(sphere, a);
    EXPECT_NEAR(ellipsoid.Radius(), 1, 1e-5);
    for (std::size_t j = 0; j < ellipsoid.triangles.size(); ++j) {
      const Eigen::Vector3f& normal = ellipsoid.normals[ellipsoid.triangles[j][0]];
      EXPECT_NEAR(normal.norm(), 1, 1e-5);
      EXPECT_GT(normal.dot(FaceNormal(ellipsoid, j)), 0.9f);
    }
    const Mesh both = Scaled(ellipsoid, b), product = Scaled(sphere, a.cwiseProduct(b));
    for (std::size_t j = 0; j < both.positions.size(); ++j) {
      EXPECT_LT((both.positions[j] - product.positions[j]).norm(), 1e-4f);
      EXPECT_LT((both.normals[j] - product.normals[j]).norm(), 1e-4f);
    }
  }
}

TEST(Scaled, RefusesFactorsThatAreNotPositive) {
  const Mesh box = MakeBox({1, 1, 1});
  EXPECT_THROW(Scaled(box, {1, 0, 1}), InvalidOption);
  EXPECT_THROW(Scaled(box, {1, -1, 1}), InvalidOption);
  EXPECT_THROW(Scaled(box, {1, NAN, 1}), InvalidOption);
}

}  // namespace
}  // namespace antipode
