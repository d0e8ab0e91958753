#include "antipode/training/view_cache.h"

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/render/mesh_pack.h"
#include "antipode/render/test_glb.h"
#include "antipode/render/test_meshes.h"
#include "antipode/training/test_objects.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

class ViewCacheTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directory(Folder());
    Mesh box = MakeBox({0.3f, 0.5f, 0.7f});
    for (Material& material : box.materials) material.texture = FourColors(32);
    folder_.Write("meshes/box.glb", GlbOf(box));
    folder_.Write("meshes/tetrahedron.glb", TetrahedronGlb(0.7f));
  }

  fs::path Folder() const { return folder_.path() / "meshes"; }
  fs::path Pack() const { return folder_.path() / "meshes.pack"; }
  void MakePack() const { PackMeshes(MeshCollection::Open(Folder()), Pack(), {}, {}); }
  std::string Description(const std::string& cache) const { return ReadFile(folder_.path() / cache / "views.json"); }
  ViewCache Open(const fs::path& meshes, const std::string& cache) const {
    return ViewCache::OpenOrRender(folder_.path() / cache, MeshCollection::Open(meshes), options_, {});
  }

  TemporaryFolder folder_;
  ViewCacheOptions options_{.views_per_object = 3, .variants = 4, .image_size = 64, .threads = 1};
};

TEST_F(ViewCacheTest, OfAFolderIsDescribedByOptionsNamesAndSizes) {
  Open(Folder(), "cache");
  const auto bytes = [&](const char* name) { return std::to_string(fs::file_size(Folder() / name)); };
  EXPECT_EQ(Description("cache"), R"({
 "format": 3,
 "image_size": 64,
 "margin": 0.19,
 "objects": [
  {
   "bytes": )" + bytes("box.glb") + R"(,
   "file": "box.glb"
  },
  {
   "bytes": )" + bytes("tetrahedron.glb") + R"(,
   "file": "tetrahedron.glb"
  }
 ],
 "seed": 1,
 "stretch": 1.35,
 "variants": 4,
 "views_per_object": 3,
 "wide_share": 0.35
})");
}

TEST_F(ViewCacheTest, APackGivesNearlyThePicturesOfItsFolder) {
  MakePack();
  const ViewCache expected = Open(Folder(), "a"), cache = Open(Pack(), "b");
  ASSERT_EQ(cache.group_count(), 8);
  for (int group = 0; group < cache.group_count(); ++group) {
    for (int view = 0; view < cache.views_per_group(); ++view) {
      EXPECT_LT(AngleBetweenDeg(cache.CameraFromObject(group, view).rotation, expected.CameraFromObject(group, view).rotation), 0.1);
      const cv::Mat difference = cache.Image(group, view) - expected.Image(group, view);
      EXPECT_LT(cv::norm(difference, cv::NORM_L1) / static_cast<double>(difference.total()), 1) << group << ", " << view;
    }
  }
}

TEST_F(ViewCacheTest, IsRenderedAnewOnlyForAnotherPack) {
  MakePack();
  Open(Pack(), "cache");
  const std::string first = Description("cache");
  const auto time = fs::last_write_time(folder_.path() / "cache" / "views.raw");
  Open(Pack(), "cache");
  EXPECT_EQ(fs::last_write_time(folder_.path() / "cache" / "views.raw"), time);
  folder_.Write("meshes/tetrahedron.glb", TetrahedronGlb(0.6f));
  MakePack();
  Open(Pack(), "cache");
  EXPECT_NE(Description("cache"), first);
}

}  // namespace
}  // namespace antipode
