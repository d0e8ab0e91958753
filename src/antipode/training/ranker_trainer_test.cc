#include "antipode/training/ranker_trainer.h"

#include <gtest/gtest.h>

#include "antipode/nn/module_weights.h"
#include "antipode/prior/object_prior.h"
#include "antipode/training/test_objects.h"
#include "antipode/training/test_stop.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

class RankerTrainerTest : public testing::Test {
 protected:
  void SetUp() override {
    torch::set_num_threads(1);
    std::filesystem::create_directory(folder_.path() / "objects");
    folder_.Write("objects/a.glb", TetrahedronGlb(0.5f));
    folder_.Write("objects/b.glb", TetrahedronGlb(0.8f));
    ObjectEncoder encoder(ObjectEncoderConfig{.image_size = 64, .max_degree = 3, .channels = 4, .width = 16, .layers = 1, .heads = 2,
                                              .feed_forward = 16, .spatial_bases = 2});
    TensorFile file = WeightsOf(*encoder);
    file.metadata = encoder->config().ToMetadata();
    SaveModel(folder_.path(), "first", file, "test", "none", "# test\n");
  }

  RankerTrainingOptions Options() const {
    RankerTrainingOptions options;
    options.objects = options.validation_objects = folder_.path() / "objects";
    options.run.out = folder_.path() / "out";
    options.prior = (folder_.path() / "first").string();
    options.run.iterations = 4;
    options.threads = 1;
    options.groups = 8;
    options.views_per_group = 3;
    options.batch = 16;
    options.ranker.points = 16;
    options.ranker.width = 8;
    options.ranker.hidden = 8;
    options.views.views_per_object = 4;
    options.views.variants = 2;
    options.views.image_size = 64;
    return options;
  }

  TemporaryFolder folder_;
};

TEST_F(RankerTrainerTest, WritesAPriorOfBothStages) {
  const RankerTrainingResult result = TrainRanker(Options());
  EXPECT_EQ(result.steps, 4);
  EXPECT_GT(result.last_loss, 0);
  const ObjectPrior prior = ObjectPrior::Load(result.model.string());
  EXPECT_TRUE(prior.HasSecondStage());
  EXPECT_FALSE(ObjectPrior::Load(Options().prior).HasSecondStage());

  const TensorFile before = LoadModel(Options().prior), after = LoadModel(result.model.string());
  for (const auto& [name, tensor] : before.tensors) EXPECT_EQ(tensor.data, after.tensors.at(name).data) << name;
  EXPECT_TRUE(after.metadata.contains("ranker_weight"));
  EXPECT_NE(ReadFile(result.model / "card.md").find("4 steps"), std::string::npos);
}

TEST_F(RankerTrainerTest, ResumesExactly) {
  RankerTrainingOptions options = Options();
  options.validation_objects.clear();
  const TensorFile whole = LoadModel(TrainRanker(options).model.string());
  options.run.minutes_between_checkpoints = 0;
  EXPECT_THROW(TrainRanker(options, StopAtStep(3)), Interrupted);
  options.run.resume = true;
  const RankerTrainingResult result = TrainRanker(options);
  EXPECT_EQ(result.steps, 4);
  const TensorFile resumed = LoadModel(result.model.string());
  for (const auto& [name, tensor] : whole.tensors) EXPECT_EQ(tensor.data, resumed.tensors.at(name).data) << name;
  options.ranker.width = 16;
  EXPECT_THROW(TrainRanker(options), BadFile);
}

TEST_F(RankerTrainerTest, RefusesImpossibleOptions) {
  RankerTrainingOptions options = Options();
  options.modes = 1;
  EXPECT_THROW(TrainRanker(options), InvalidOption);
  options = Options();
  options.objects = folder_.path() / "none";
  EXPECT_THROW(TrainRanker(options), Error);
}

}  // namespace
}  // namespace antipode
