#include "antipode/training/views_trainer.h"

#include <gtest/gtest.h>

#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/training/augmentation.h"
#include "antipode/training/test_objects.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

ViewDiffusionConfig TinyConfig() {
  ViewDiffusionConfig config;
  config.image_size = 16;
  config.patch = 4;
  config.unet.base_width = 32;
  config.unet.multipliers = {1, 2};
  config.unet.residual_blocks = 1;
  config.unet.attention_factors = {2};
  config.unet.heads = 4;
  config.unet.context_width = 32;
  return config;
}

ViewsTrainingOptions TinyTraining(const std::filesystem::path& folder) {
  WriteFileAtomically(folder / "objects" / "tetrahedron.glb", TetrahedronGlb(0.8f));
  ViewsTrainingOptions options;
  options.objects = folder / "objects";
  options.run.out = folder / "out";
  options.prior.clear();
  options.objects_per_step = 1;
  options.views_per_object = 6;
  options.run.learning_rate = 4e-3;
  options.run.average_decay = 0.98;
  options.views.views_per_object = 6;
  options.views.variants = 1;
  options.views.image_size = 64;
  options.views.wide_share = 0;
  options.augmentation.mirror_share = 0;
  options.augmentation.level_share = 1;
  options.augmentation.level_deviation_deg = 0;
  return options;
}

TEST(TrainViews, OverfitsOneObject) {
  torch::set_num_threads(1);  // faster than two for so small a network
  const TemporaryFolder temporary;
  ViewsTrainingOptions options = TinyTraining(temporary.path());
  options.run.iterations = 600;
  options.views.views_per_object = options.views_per_object = 3;  // six pairs of a picture and a view: soon known by heart
  options.run.learning_rate = 2e-3;
  const TrainingResult result = TrainViews(options, TinyConfig());
  EXPECT_LT(result.last_loss, 0.3 * result.first_loss) << result.first_loss << " to " << result.last_loss;

  const TensorFile file = LoadModel(result.model.string());
  ViewDiffusion model(ViewDiffusionConfig::FromMetadata(file.metadata, "model"));
  LoadInto(*model, file, "model");
  const ViewCache cache = ViewCache::OpenOrRender(options.run.out / "cache", MeshCollection::Open(options.objects), options.views, {});
  const AugmentedView from = PlainView(cache, 0, 0, 16);
  const torch::Tensor picture = OnWhite(from);
  double sampled = 0, copied = 0;
  for (int view = 1; view < 3; ++view) {
    const AugmentedView to = PlainView(cache, 0, view, 16);
    const torch::Tensor truth = OnWhite(to);
    const std::vector<ViewCondition> condition{{to.camera_from_object.rotation * from.camera_from_object.rotation.transpose(), {}}};
    const std::vector<std::string> name{std::to_string(view)};
    const Zero123Options sampling{.solver = Solver::kDpmSolverPlusPlus, .steps = 12, .eta = 0, .guidance_scale = 1};
    sampled += PeakSignalToNoise(model->SampleViews(picture * 2 - 1, condition, name, sampling), truth) / 2;
    copied += PeakSignalToNoise(picture, truth) / 2;
  }
  RecordProperty("psnr_of_sampled_views_db", std::to_string(sampled));
  EXPECT_GT(sampled, copied + 2) << "a sampled view resembles its target more than the picture itself does";
}

TEST(TrainViews, ResumesWhereItStopped) {
  const TemporaryFolder temporary;
  ViewsTrainingOptions options = TinyTraining(temporary.path());
  options.run.iterations = 3;
  TrainViews(options, TinyConfig());
  const TensorFile stopped = SafetensorsReader(options.run.out / "checkpoint.safetensors").ReadAll();
  EXPECT_EQ(stopped.metadata.at("step"), "3");
  options.run.resume = true;
  EXPECT_EQ(TrainViews(options, TinyConfig()).steps, 3) << "the budget is used up";
  const TensorFile same = SafetensorsReader(options.run.out / "checkpoint.safetensors").ReadAll();
  for (const auto& [name, tensor] : stopped.tensors) EXPECT_TRUE(torch::equal(ToTorch(tensor), ToTorch(same.tensors.at(name)))) << name;
  options.run.iterations = 5;
  EXPECT_EQ(TrainViews(options, TinyConfig()).steps, 5);
  ViewDiffusionConfig other = TinyConfig();
  other.target = DiffusionTarget::kNoise;
  EXPECT_THROW(TrainViews(options, other), BadFile);
}

TEST(ViewDiffusion, ANetworkThatKnowsTheVelocityGivesBackThePicture) {
  const auto clean = torch::rand({2, 3, 8, 8}) * 2 - 1, noise = torch::randn({2, 3, 8, 8});
  for (const double alpha_bar : {0.02, 0.5, 0.97}) {
    const auto alpha = torch::full({2, 1, 1, 1}, alpha_bar);
    const auto x = std::sqrt(alpha_bar) * clean + std::sqrt(1 - alpha_bar) * noise;
    for (const auto target : {DiffusionTarget::kNoise, DiffusionTarget::kVelocity})
      EXPECT_TRUE(torch::allclose(NoiseFromTarget(target, TargetOf(target, clean, noise, alpha), x, alpha_bar), noise, 1e-4, 1e-5));
  }
}

TEST(ViewDiffusion, HidesPicturePoseAndGuideForGuidance) {
  const torch::InferenceMode inference;
  ViewDiffusionConfig config = TinyConfig();
  config.cell = 2;
  config.guide_channels = 3;
  ViewDiffusion model(config);
  FillSynthetic(*model);
  const auto noisy = torch::rand({1, 3, 16, 16}), time = torch::tensor({300.f});
  const auto say = [&](double shade, double turn, double guide, float conditional) {
    const auto pose = torch::full({1, 9}, turn), guides = torch::full({1, 3, 4, 4}, guide);
    return model->forward(noisy, torch::full({1, 3, 16, 16}, shade), time, pose, torch::tensor({conditional}), guides);
  };
  EXPECT_EQ(say(0.2, 0.1, 0, 1).sizes(), noisy.sizes());
  EXPECT_TRUE(torch::allclose(say(0.2, 0.1, 0, 0), say(-0.7, 0.9, 0.5, 0)));
  EXPECT_FALSE(torch::allclose(say(0.2, 0.1, 0, 1), say(-0.7, 0.1, 0, 1)));
  EXPECT_FALSE(torch::allclose(say(0.2, 0.1, 0, 1), say(0.2, 0.9, 0, 1)));
  EXPECT_FALSE(torch::allclose(say(0.2, 0.1, 0, 1), say(0.2, 0.1, 0.5, 1)));
  EXPECT_THROW(model->forward(noisy, noisy, time, torch::zeros({1, 9}), torch::ones({1})), Error) << "without a guide";
}

TEST(ViewDiffusion, ConfigurationsSurviveTheMetadata) {
  ViewDiffusionConfig config = ViewDiffusionConfig::Small();
  config.pose = PoseCondition::kZero123;
  EXPECT_EQ(ViewDiffusionConfig::FromMetadata(config.ToMetadata(), "x").ToMetadata(), config.ToMetadata());
  EXPECT_THROW(ViewDiffusionConfig::FromMetadata({}, "x"), BadFile);
  auto metadata = config.ToMetadata();
  metadata["config"] = "{";
  EXPECT_THROW(ViewDiffusionConfig::FromMetadata(metadata, "x"), BadFile);
}

}  // namespace
}  // namespace antipode
