#include <cstring>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "antipode/evaluation/dataset.h"
#include "antipode/geometry/look_at.h"
#include "antipode/util/error.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

void AppendChunk(std::string& glb, const char* type, std::string content, char padding) {
  content.resize((content.size() + 3) / 4 * 4, padding);
  const auto length = static_cast<std::uint32_t>(content.size());
  glb.append(reinterpret_cast<const char*>(&length), 4).append(type, 4).append(content);
}

/// A binary glTF file of a tetrahedron about (10, 0, 0).
void WriteTetrahedron(const fs::path& path) {
  const float positions[] = {11, 1, 1, 11, -1, -1, 9, 1, -1, 9, -1, 1};
  const std::uint16_t indices[] = {0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2};
  std::string buffer(reinterpret_cast<const char*>(positions), sizeof positions);
  buffer.append(reinterpret_cast<const char*>(indices), sizeof indices);
  const nlohmann::json json{
      {"asset", {{"version", "2.0"}}},
      {"scene", 0},
      {"scenes", {{{"nodes", {0}}}}},
      {"nodes", {{{"mesh", 0}}}},
      {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"indices", 1}}}}}}},
      {"buffers", {{{"byteLength", buffer.size()}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", sizeof positions}},
        {{"buffer", 0}, {"byteOffset", sizeof positions}, {"byteLength", sizeof indices}}}},
      {"accessors",
       {{{"bufferView", 0},
         {"componentType", 5126},
         {"count", 4},
         {"type", "VEC3"},
         {"min", {9, -1, -1}},
         {"max", {11, 1, 1}}},
        {{"bufferView", 1}, {"componentType", 5123}, {"count", 12}, {"type", "SCALAR"}}}}};
  std::string chunks;
  AppendChunk(chunks, "JSON", json.dump(), ' ');
  AppendChunk(chunks, "BIN\0", buffer, '\0');
  const std::uint32_t header[] = {0x46546c67, 2, static_cast<std::uint32_t>(chunks.size() + 12)};
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(header), sizeof header) << chunks;
}

void WriteManifest(const fs::path& folder, const nlohmann::json& objects) {
  std::ofstream(folder / "manifest.json") << nlohmann::json{{"objects", objects}};
}

class ObjectDatasetTest : public testing::Test {
 protected:
  ObjectDatasetTest() {
    fs::create_directory(root());
    WriteTetrahedron(root() / "can.glb");
    WriteTetrahedron(root() / "shoe.glb");
  }
  fs::path root() const { return temporary_.path() / "test"; }
  fs::path parent() const { return temporary_.path(); }

 private:
  TemporaryFolder temporary_;
};

constexpr ObjectProtocolOptions kSmall{.views = 4, .image_size = 48};

TEST_F(ObjectDatasetTest, FirstViewIsTheReferenceOfTheOthers) {
  const ObjectDataset dataset(root(), kSmall);
  EXPECT_EQ(dataset.Name(), "objects");
  ASSERT_EQ(dataset.ObjectCount(), 2u);
  EXPECT_EQ(dataset.PairCount(), 6u);
  const EvaluationScene scene = dataset.Load(1);
  EXPECT_EQ(scene.object, "shoe");
  EXPECT_FALSE(scene.symmetric);
  ASSERT_EQ(scene.views.size(), 4u);
  ASSERT_EQ(scene.pairs.size(), 3u);
  for (std::size_t i = 0; i < scene.pairs.size(); ++i) {
    EXPECT_EQ(scene.pairs[i].reference, 0u);
    EXPECT_EQ(scene.pairs[i].query, i + 1);
  }
}

TEST_F(ObjectDatasetTest, DefaultsToThePapersTwentyQueries) {
  EXPECT_EQ(ObjectDataset(root()).PairCount(), 40u);
}

TEST_F(ObjectDatasetTest, ViewsShowTheCentredObjectByTheProtocol) {
  const EvaluationScene scene = ObjectDataset(root(), kSmall).Load(0);
  for (const SceneView& view : scene.views) {
    EXPECT_EQ(view.photograph.image.size(), cv::Size(48, 48));
    EXPECT_EQ(view.photograph.image.type(), CV_8UC3);
    EXPECT_EQ(view.photograph.mask.type(), CV_8UC1);
    EXPECT_GT(view.photograph.mask.at<uchar>(24, 24), 125);  // the middle of the tetrahedron
    EXPECT_EQ(view.photograph.mask.at<uchar>(0, 0), 0);
    const Viewpoint viewpoint = ViewpointFromRotation(view.camera_from_object.rotation);
    EXPECT_GE(viewpoint.elevation, 0);
    EXPECT_LE(viewpoint.elevation, 60);
    EXPECT_NEAR(viewpoint.in_plane_rotation, 0, 1e-6);
    EXPECT_NEAR(view.camera_from_object.translation.norm(), 3.5, 1e-9);
  }
}

TEST_F(ObjectDatasetTest, RepeatsWithItsSeed) {
  ObjectProtocolOptions other = kSmall;
  other.seed = 1;
  const EvaluationScene first = ObjectDataset(root(), kSmall).Load(0);
  const EvaluationScene again = ObjectDataset(root(), kSmall).Load(0);
  const EvaluationScene reseeded = ObjectDataset(root(), other).Load(0);
  EXPECT_EQ(first.views[2].camera_from_object.Matrix(), again.views[2].camera_from_object.Matrix());
  EXPECT_EQ(cv::norm(first.views[2].photograph.image, again.views[2].photograph.image), 0);
  EXPECT_NE(first.views[2].camera_from_object.Matrix(),
            reseeded.views[2].camera_from_object.Matrix());
}

TEST_F(ObjectDatasetTest, RotatedImagesRollWithinTheRange) {
  ObjectProtocolOptions rotated = kSmall;
  rotated.views = 12;
  rotated.in_plane_rotation_deg = 45;
  double greatest = 0;
  for (const SceneView& view : ObjectDataset(root(), rotated).Load(0).views) {
    const double roll =
        std::abs(ViewpointFromRotation(view.camera_from_object.rotation).in_plane_rotation);
    EXPECT_LE(roll, 45);
    greatest = std::max(greatest, roll);
  }
  EXPECT_GT(greatest, 20);
}

TEST_F(ObjectDatasetTest, SymmetryComesFromTheManifestBesideOrAbove) {
  WriteManifest(parent(), {{{"id", "x"}, {"file", "test/can.glb"}, {"symmetric", "rotational"}},
                           {{"id", "shoe"}, {"symmetric", "none"}},
                           {{"id", "no entry"}}});
  EXPECT_TRUE(ObjectDataset(root(), kSmall).Load(0).symmetric);
  EXPECT_FALSE(ObjectDataset(root(), kSmall).Load(1).symmetric);
  WriteManifest(root(), {{{"id", "shoe"}, {"symmetric", "approximate"}}});
  EXPECT_FALSE(ObjectDataset(root(), kSmall).Load(0).symmetric);
  EXPECT_TRUE(ObjectDataset(root(), kSmall).Load(1).symmetric);
}

TEST_F(ObjectDatasetTest, RefusesBrokenManifests) {
  const auto refuses = [&](const std::string& text) {
    std::ofstream(root() / "manifest.json") << text;
    EXPECT_THROW(ObjectDataset(root(), kSmall), BadFile) << text;
  };
  refuses("{");
  refuses("[]");
  refuses("{\"objects\": 3}");
  refuses("{\"objects\": [3]}");
  refuses("{\"objects\": [{\"id\": 3}]}");
}

TEST_F(ObjectDatasetTest, RefusesWhatCannotBeRendered) {
  EXPECT_THROW(ObjectDataset(parent() / "missing", kSmall), BadFile);
  EXPECT_THROW(ObjectDataset(parent(), kSmall), BadFile);  // holds no mesh itself
  ObjectProtocolOptions one_view = kSmall;
  one_view.views = 1;
  EXPECT_THROW(ObjectDataset(root(), one_view), InvalidOption);
  std::ofstream(root() / "can.glb") << "not a mesh";
  EXPECT_THROW(ObjectDataset(root(), kSmall).Load(0), BadFile);
}

}  // namespace
}  // namespace antipode
