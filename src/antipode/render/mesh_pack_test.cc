#include "antipode/render/mesh_pack.h"

#include <fstream>
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include "antipode/render/mesh_collection.h"
#include "antipode/render/test_glb.h"
#include "antipode/render/test_meshes.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

cv::Mat Noise(int side, int seed) {
  cv::Mat texture(side, side, CV_8UC3);
  cv::RNG random(seed);
  random.fill(texture, cv::RNG::UNIFORM, 0, 256);
  return texture;
}

Mesh TexturedBox(const cv::Mat& texture) {
  Mesh box = MakeBox({0.3f, 0.4f, 0.5f});
  for (std::size_t i = 0; i < box.materials.size(); ++i) {
    box.materials[i].base_color = Eigen::Vector3f(0.5f, 0.25f, 0.125f * static_cast<float>(i));
    if (i % 2 == 0) box.materials[i].texture = texture;
  }
  return box;
}

std::string MessageOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const BadFile& error) {
    return error.what();
  }
  return {};
}

/// A folder of three meshes: a box with a texture, a ball, a coloured box with the same texture.
class MeshPackTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directory(Folder());
    Mesh colored = TexturedBox(FourColors(64));
    colored.colors.assign(colored.positions.size(), {0.1f, 0.5f, 1});
    folder_.Write("meshes/a box.glb", GlbOf(TexturedBox(FourColors(64))));
    folder_.Write("meshes/ball.glb", GlbOf(MakeSphere(0.8f, 12)));
    folder_.Write("meshes/coloured.glb", GlbOf(colored));
    folder_.Write("meshes/notes.txt", "no mesh");
  }

  fs::path Folder() const { return folder_.path() / "meshes"; }
  fs::path Pack() const { return folder_.path() / "all.pack"; }
  MeshPackResult MakePack(double megabytes = 28) const { return PackMeshes(MeshCollection::Open(Folder()), Pack(), {megabytes}, {}); }

  /// The file with other entries, by name; one without bytes is left out.
  fs::path WithEntry(const std::string& name, const std::string& content) const {
    const ZipArchive archive(InputFile{Pack()});
    std::map<std::string, std::vector<std::byte>> contents;
    for (const auto& [entry, place] : archive.entries()) contents[entry] = archive.Read(entry);
    const auto bytes = std::as_bytes(std::span(content));
    contents[name] = {bytes.begin(), bytes.end()};
    std::vector<ZipEntry> entries;
    for (const auto& [entry, all] : contents)
      if (!all.empty()) entries.push_back({entry, all});
    return folder_.Write("changed.pack", MakeZipArchive(entries));
  }

  TemporaryFolder folder_;
};

TEST_F(MeshPackTest, HoldsTheMeshesOfTheFolderUnderTheirNames) {
  const MeshPackResult result = MakePack();
  const MeshCollection folder = MeshCollection::Open(Folder()), pack = MeshCollection::Open(Pack());
  ASSERT_EQ(folder.size(), 3u);
  ASSERT_EQ(pack.size(), 3u);
  std::int64_t triangles = 0;
  for (std::size_t i = 0; i < folder.size(); ++i) {
    EXPECT_EQ(pack.Name(i), folder.Name(i));
    const Mesh whole = folder.Load(i), packed = pack.Load(i);
    EXPECT_EQ(packed.triangles, whole.triangles);
    EXPECT_EQ(packed.triangle_materials, whole.triangle_materials);
    ASSERT_EQ(packed.positions.size(), whole.positions.size());
    for (std::size_t j = 0; j < whole.positions.size(); ++j)
      EXPECT_LT((packed.positions[j] - whole.positions[j]).norm(), result.greatest_position_error + 1e-7);
    triangles += static_cast<std::int64_t>(whole.triangles.size());
  }
  EXPECT_EQ(folder.Name(0), "a box.glb");
  EXPECT_EQ(result.objects, 3);
  EXPECT_EQ(result.triangles, triangles);
  EXPECT_EQ(result.bytes, fs::file_size(Pack()));
  EXPECT_LT(result.greatest_position_error, std::sqrt(3) / 65535);
}

TEST_F(MeshPackTest, KeepsMaterialsAndTexturesOnceEach) {
  EXPECT_EQ(MakePack().textures, 1);
  const Mesh whole = MeshCollection::Open(Folder()).Load(2), packed = MeshCollection::Open(Pack()).Load(2);
  ASSERT_EQ(packed.materials.size(), whole.materials.size());
  for (std::size_t i = 0; i < whole.materials.size(); ++i) {
    EXPECT_EQ(packed.materials[i].base_color, whole.materials[i].base_color);
    const cv::Mat &texture = whole.materials[i].texture, &again = packed.materials[i].texture;
    ASSERT_EQ(again.size(), texture.size());
    EXPECT_LE(cv::norm(texture, again, cv::NORM_L1), 3.0 * static_cast<double>(texture.total()));
  }
}

TEST_F(MeshPackTest, SameMeshesGiveTheSameBytes) {
  MakePack();
  const std::string first = ReadFile(Pack());
  MakePack();
  EXPECT_EQ(ReadFile(Pack()), first);
}

TEST_F(MeshPackTest, TexturesAreReducedUntilTheFileFits) {
  folder_.Write("meshes/noise.glb", GlbOf(TexturedBox(Noise(200, 1))));
  EXPECT_EQ(MakePack().texture_side, 512);
  const MeshPackResult small = MakePack(0.01);
  EXPECT_LE(fs::file_size(Pack()), static_cast<std::uintmax_t>(0.01 * (1 << 20)));
  EXPECT_LT(small.texture_side, 200);
  EXPECT_EQ(MeshCollection::Open(Pack()).Load(3).materials[0].texture.cols, small.texture_side);
}

TEST_F(MeshPackTest, SaysWhatToDoIfTheLimitCannotBeMet) {
  try {
    MakePack(0.001);
    FAIL() << "fits";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("--megabytes"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(fs::exists(Pack()));
  EXPECT_THROW(MakePack(0), InvalidOption);
}

TEST_F(MeshPackTest, InterruptionLeavesNothing) {
  const auto stop = [](const Progress&) { throw Interrupted("test", "stops"); };
  EXPECT_THROW(PackMeshes(MeshCollection::Open(Folder()), Pack(), {}, stop), Interrupted);
  EXPECT_FALSE(fs::exists(Pack()));
}

TEST_F(MeshPackTest, ManyThreadsReadTheSameMeshes) {
  MakePack();
  const MeshCollection pack = MeshCollection::Open(Pack());
  const auto expected = pack.Load(1).positions;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i)
    threads.emplace_back([&, copy = pack] {
      for (int j = 0; j < 20; ++j) EXPECT_EQ(copy.Load(1).positions, expected);
    });
}

TEST_F(MeshPackTest, DamagedFilesAreRefusedByName) {
  MakePack();
  const std::string whole = ReadFile(Pack());
  std::mt19937_64 random(1);
  for (int i = 0; i < 300; ++i) {
    std::string damaged = whole;
    if (i % 3 == 0) damaged.resize(random() % whole.size());
    else damaged[random() % whole.size()] ^= static_cast<char>(1 + random() % 255);
    const fs::path path = folder_.Write("damaged.pack", damaged);
    // Some bytes, such as dates, mean nothing: then the meshes are as they were.
    const std::string message = MessageOf([&] {
      const MeshCollection meshes = MeshCollection::Open(path);
      for (std::size_t j = 0; j < meshes.size(); ++j) meshes.Load(j).Check();
    });
    EXPECT_TRUE(!message.empty() || i % 3 != 0) << "cut short";
    EXPECT_TRUE(message.empty() || message.find("damaged.pack") != std::string::npos) << message;
  }
}

TEST_F(MeshPackTest, ForeignAndIncompleteFilesAreRefused) {
  MakePack();
  const auto refused = [&](const fs::path& path, const std::string& mentions) {
    const std::string message = MessageOf([&] {
      const MeshCollection meshes = MeshCollection::Open(path);
      for (std::size_t i = 0; i < meshes.size(); ++i) meshes.Load(i);
    });
    EXPECT_NE(message.find(mentions), std::string::npos) << message;
    EXPECT_NE(message.find(path.filename().string()), std::string::npos) << message;
  };
  fs::create_directory(folder_.path() / "empty");
  refused(folder_.path() / "empty", "holds no .glb file");
  refused(folder_.path() / "none.pack", "does not exist");
  refused(folder_.Write("empty.pack", ""), "not a pack");
  refused(folder_.Write("text.pack", "meshes"), "not a pack");
  refused(WithEntry("antipode-meshes", ""), "not a pack");
  refused(WithEntry("antipode-meshes", "short"), "damaged list");
  refused(WithEntry("antipode-meshes", std::string("\2\0\0\0\1\0\0\0a\0b\0c\0", 14)), "version 2");
  refused(WithEntry("antipode-meshes", std::string("\1\0\0\0\1\0\0\0a\0b\0", 12)), "lacks a mesh");
  refused(WithEntry("mesh 1", ""), "lacks a mesh");
  refused(WithEntry("mesh 1", "not a mesh"), "'ball.glb' is damaged");
  refused(WithEntry("texture 0", "no picture"), "texture 0 cannot be decoded");
  refused(WithEntry("surplus", "x"), "lacks a mesh");
}

}  // namespace
}  // namespace antipode
