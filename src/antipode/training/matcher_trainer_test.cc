#include "antipode/training/matcher_trainer.h"

#include <gtest/gtest.h>

#include "antipode/matching/xfeat_matcher.h"
#include "antipode/render/mesh_collection.h"
#include "antipode/render/mesh_pack.h"
#include "antipode/training/test_objects.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

MatcherTrainingOptions TinyTraining(const std::filesystem::path& folder) {
  WriteFileAtomically(folder / "objects" / "tetrahedron.glb", TetrahedronGlb(0.8f));
  MatcherTrainingOptions options;
  options.objects = folder / "objects";
  options.run.out = folder / "out";
  options.run.iterations = 2;
  options.points = 96;
  options.features = 128;
  options.pairs.views = 4;
  options.pairs.crop_pairs = options.pairs.halfway_pairs = 1;
  return options;
}

bool HaveTheSameWeights(const TensorFile& a, const TensorFile& b) {
  return std::ranges::all_of(a.tensors, [&](const auto& item) { return b.tensors.at(item.first).data == item.second.data; });
}

TEST(TrainMatcher, WritesAModelThatMatchesAndGoesOnFromIt) {
  const TemporaryFolder temporary;
  MatcherTrainingOptions options = TinyTraining(temporary.path());
  const TrainingResult result = TrainMatcher(options);
  EXPECT_EQ(result.steps, 2);
  EXPECT_GT(result.last_loss, 0);
  const TensorFile trained = LoadModel(result.model.string());
  EXPECT_FALSE(HaveTheSameWeights(trained, LoadModel(kXFeatLighterGlueModel)));
  const cv::Mat blank(64, 64, CV_8UC3, cv::Scalar::all(200));
  EXPECT_EQ(XFeatLighterGlueMatcher::Load(result.model.string()).Match(blank, blank).size(), 0U);

  options.run.resume = true;
  options.run.iterations = 3;
  EXPECT_EQ(TrainMatcher(options).steps, 3);
}

TEST(TrainMatcher, SameSeedGivesTheSameModel) {
  const TemporaryFolder one, other;
  const auto a = TrainMatcher(TinyTraining(one.path())), b = TrainMatcher(TinyTraining(other.path()));
  EXPECT_TRUE(HaveTheSameWeights(LoadModel(a.model.string()), LoadModel(b.model.string())));
}

TEST(TrainMatcher, StartsFromALighterGlueWithoutItsXFeat) {
  const TemporaryFolder temporary;
  MatcherTrainingOptions options = TinyTraining(temporary.path());
  options.run.iterations = 1;
  options.start = kObjectLighterGlueModel;
  const TrainingResult result = TrainMatcher(options);
  EXPECT_FALSE(HaveTheSameWeights(LoadModel(result.model.string()), LoadModel(kObjectLighterGlueModel)));
}

TEST(TrainMatcher, TakesAPackInPlaceOfAFolder) {
  const TemporaryFolder temporary;
  MatcherTrainingOptions options = TinyTraining(temporary.path());
  const std::filesystem::path pack = temporary.path() / "objects.pack";
  PackMeshes(MeshCollection::Open(options.objects), pack, {}, {});
  options.objects = pack;
  options.run.iterations = 1;
  EXPECT_EQ(TrainMatcher(options).steps, 1);
}

TEST(TrainMatcher, RefusesWhatCannotWork) {
  const TemporaryFolder temporary;
  MatcherTrainingOptions options = TinyTraining(temporary.path());
  options.run.resume = true;
  EXPECT_THROW(TrainMatcher(options), BadFile);  // nothing to resume
  options.run.resume = false;
  options.points = options.features + 1;
  EXPECT_THROW(TrainMatcher(options), InvalidOption);
  options = TinyTraining(temporary.path());
  std::filesystem::create_directories(temporary.path() / "empty");
  options.objects = temporary.path() / "empty";
  EXPECT_THROW(TrainMatcher(options), BadFile);
}

}  // namespace
}  // namespace antipode
