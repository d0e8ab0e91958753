#include "antipode/training/view_comparison_trainer.h"

#include <gtest/gtest.h>

#include "antipode/gen6d/shared_backbone.h"
#include "antipode/nn/efficientnet_lite.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/pose/view_comparison.h"
#include "antipode/render/mesh_collection.h"
#include "antipode/render/mesh_pack.h"
#include "antipode/training/test_objects.h"
#include "antipode/training/test_stop.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

/// A model with nothing but a backbone.
std::string SaveBackbone(const std::filesystem::path& folder, const std::string& name, const std::string& values) {
  EfficientNetLite0 network;
  FillSynthetic(*network, values);
  TensorFile file;
  AddWithPrefix(file, WeightsOf(*network), "backbone.");
  SaveModel(folder, name, file, "test", "none", "# test\n");
  return (folder / name).string();
}

ViewComparisonTrainingOptions TinyTraining(const std::filesystem::path& folder) {
  WriteFileAtomically(folder / "objects" / "tetrahedron.glb", TetrahedronGlb(0.8f));
  ViewComparisonTrainingOptions options;
  options.objects = folder / "objects";
  options.run.out = folder / "out";
  options.backbone_model = SaveBackbone(folder, "backbone", "a.");
  options.run.iterations = 4;
  options.batch = 1;
  options.views = 8;
  options.rendering.views = 8;
  options.rendering.query_groups = 1;
  options.rendering.queries_per_group = 2;
  return options;
}

SelectorConfig TinySelector() {
  return {.backbone = BackboneKind::kEfficientNetLite0, .correlation_width = 4, .width = 16, .heads = 2};
}
RefinerConfig TinyRefiner() {
  return {.backbone = BackboneKind::kEfficientNetLite0, .finest_stride = 8, .feature_width = 4, .volume_width = 4, .grid = 16, .regressor_width = 8};
}

TEST(TrainRefiner, LeavesTheBackboneWhereItIsAndResumesExactly) {
  const TemporaryFolder temporary;
  ViewComparisonTrainingOptions options = TinyTraining(temporary.path());
  const TensorFile whole = LoadModel(TrainRefiner(options, TinyRefiner()).model.string());
  for (const auto& [name, tensor] : whole.tensors) EXPECT_FALSE(IsBackbone(name)) << name;
  EXPECT_EQ(whole.metadata.at("steps"), "4");

  options.run.minutes_between_checkpoints = 0;
  EXPECT_THROW(TrainRefiner(options, TinyRefiner(), StopAtStep(3)), Interrupted);
  options.run.resume = true;
  const auto result = TrainRefiner(options, TinyRefiner());
  EXPECT_EQ(result.steps, 4);
  const TensorFile resumed = LoadModel(result.model.string());
  for (const auto& [name, tensor] : whole.tensors) EXPECT_EQ(tensor.data, resumed.tensors.at(name).data) << name;
  EXPECT_NO_THROW(ViewComparison::Load("", result.model.string()));

  SaveBackbone(temporary.path(), "backbone", "b.");
  EXPECT_THROW(TrainRefiner(options, TinyRefiner()), BadFile);
}

TEST(TrainSelector, TheModelOnlyLoadsBesideItsBackbone) {
  const TemporaryFolder temporary;
  const ViewComparisonTrainingOptions options = TinyTraining(temporary.path());
  const auto result = TrainSelector(options, TinySelector());
  EXPECT_TRUE(std::isfinite(result.last_loss));
  EXPECT_NO_THROW(ViewComparison::Load(result.model.string(), ""));
  SaveBackbone(temporary.path(), "backbone", "b.");
  EXPECT_THROW(ViewComparison::Load(result.model.string(), ""), BadFile);
}

TEST(RenderPosedObjects, QueriesShowTheObjectWhereTheirPosesSay) {
  const TemporaryFolder temporary;
  WriteFileAtomically(temporary.path() / "a.glb", TetrahedronGlb(0.8f));
  const auto objects = RenderPosedObjects(temporary.path(), {.views = 8, .query_groups = 1, .queries_per_group = 3});
  ASSERT_EQ(objects.size(), 1u);
  for (const PosedPicture& query : objects[0].groups[0].queries) {
    const Eigen::Vector2d centre = (query.intrinsics * query.camera_from_object.translation).hnormalized();
    const auto pixel = query.rgb.at<cv::Vec3b>(static_cast<int>(std::lround(centre.y())), static_cast<int>(std::lround(centre.x())));
    EXPECT_NE(pixel, cv::Vec3b::all(255)) << "the tetrahedron holds its sphere's centre";
  }
  EXPECT_THROW(RenderPosedObjects(temporary.path() / "none", {}), Error);
}

TEST(RenderPosedObjects, TakesAPackInPlaceOfAFolder) {
  const TemporaryFolder temporary;
  const std::filesystem::path folder = temporary.path() / "meshes", pack = temporary.path() / "meshes.pack";
  for (const char* name : {"a.glb", "b.glb", "c.glb"}) WriteFileAtomically(folder / name, TetrahedronGlb(static_cast<float>(name[0] - 'a') / 4));
  PackMeshes(MeshCollection::Open(folder), pack, {}, {});
  const PosedObjectOptions options{.views = 8, .query_groups = 1, .queries_per_group = 2, .image_size = 64};
  const auto expected = RenderPosedObjects(folder, options), objects = RenderPosedObjects(pack, options);
  ASSERT_EQ(objects.size(), 3u);
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const cv::Mat &a = expected[i].groups[0].queries[1].rgb, &b = objects[i].groups[0].queries[1].rgb;
    EXPECT_LT(cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total()), 0.5) << "object " << i;
  }
}

}  // namespace
}  // namespace antipode
