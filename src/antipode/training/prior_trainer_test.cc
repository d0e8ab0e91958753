#include "antipode/training/prior_trainer.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/prior/object_prior.h"
#include "antipode/render/mesh_pack.h"
#include "antipode/training/batch_loader.h"
#include "antipode/training/test_objects.h"
#include "antipode/training/test_stop.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/safetensors.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

class PriorTrainerTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directory(folder_.path() / "objects");
    for (int i = 0; i < 3; ++i)
      folder_.Write("objects/object" + std::to_string(i) + ".glb", TetrahedronGlb(0.5f + 0.2f * i));
  }

  PriorTrainingOptions Options(const std::string& out) const {
    PriorTrainingOptions options;
    options.objects = folder_.path() / "objects";
    options.out = folder_.path() / out;
    options.cache = folder_.path() / "cache";
    options.iterations = 4;
    options.device = "cpu";
    options.threads = 1;
    options.objects_per_step = 2;
    options.views_per_object = 3;
    options.frozen_batches = 2;
    options.frozen_epochs = 1;
    options.grid_size = 128;
    options.views.views_per_object = 4;
    options.views.variants = 1;
    options.views.image_size = 64;
    options.encoder.image_size = 32;
    options.encoder.max_degree = 3;
    options.encoder.channels = 4;
    options.encoder.width = 16;
    options.encoder.layers = 1;
    options.encoder.heads = 2;
    options.encoder.feed_forward = 16;
    options.encoder.spatial_bases = 2;
    return options;
  }

  TemporaryFolder folder_;
};

TEST_F(PriorTrainerTest, AResumedRunGivesTheSameWeights) {
  const auto whole = TrainPrior(Options("whole"), StartFrom::kScratch, {});
  EXPECT_EQ(whole.steps, 4);

  // Stop in the second stage by a callback that throws after the first checkpoint.
  PriorTrainingOptions parts = Options("parts");
  parts.minutes_between_checkpoints = 0;
  EXPECT_THROW(TrainPrior(parts, StartFrom::kScratch, StopAtStep(4)), Interrupted);
  EXPECT_EQ(SafetensorsReader(parts.out / "checkpoint.safetensors").metadata().at("step"), "3");
  const auto resumed = TrainPrior(parts, StartFrom::kCheckpoint, {});
  EXPECT_EQ(resumed.steps, 4);

  const TensorFile a = SafetensorsReader(whole.model / "model.safetensors").ReadAll();
  const TensorFile b = SafetensorsReader(resumed.model / "model.safetensors").ReadAll();
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) EXPECT_EQ(tensor.data, b.tensors.at(name).data) << name;
}

TEST_F(PriorTrainerTest, WritesAModelThatLoadsAndALog) {
  PriorTrainingOptions options = Options("out");
  options.validation_objects = options.objects;
  const auto result = TrainPrior(options, StartFrom::kScratch, {});
  const ObjectPrior prior = ObjectPrior::Load(result.model.string());
  EXPECT_EQ(prior.ViewOptions().size, 32);
  EXPECT_GT(prior.calibration().temperature, 0);
  const std::string log = ReadFile(options.out / "log.csv");
  EXPECT_EQ(log.find("step,minutes,loss"), 0u);
  EXPECT_NE(log.find("\n4,"), std::string::npos);
}

TEST_F(PriorTrainerTest, TrainsAndValidatesOnPacks) {
  PriorTrainingOptions options = Options("out");
  const fs::path pack = folder_.path() / "objects.pack";
  PackMeshes(MeshCollection::Open(options.objects), pack, {}, {});
  options.objects = options.validation_objects = pack;
  const auto result = TrainPrior(options, StartFrom::kScratch, {});
  EXPECT_EQ(result.steps, 4);
  EXPECT_GT(ObjectPrior::Load(result.model.string()).calibration().temperature, 0);
}

TEST_F(PriorTrainerTest, GoesOnFromAnotherPriorWithoutTrainingTheHeadFirst) {
  const auto first = TrainPrior(Options("first"), StartFrom::kScratch, {});
  PriorTrainingOptions options = Options("second");
  options.start = first.model.string();
  options.learning_rate = options.backbone_learning_rate = 1e-12;
  std::vector<std::string> stages;
  const auto second = TrainPrior(options, StartFrom::kModel, [&](const Progress& progress) { stages.push_back(progress.stage); });
  EXPECT_EQ(std::ranges::count(stages, "training the head"), 0);
  EXPECT_EQ(std::ranges::count(stages, "training"), 4);
  const auto images = torch::linspace(0, 1, 2 * 3 * 32 * 32).view({2, 3, 32, 32});
  const auto code = [&](const fs::path& model) { return ObjectPrior::Load(model.string()).EncodeImages(images); };
  EXPECT_TRUE(torch::allclose(code(first.model), code(second.model), 1e-2, 1e-3));
}

TEST_F(PriorTrainerTest, RefusesToStartFromAPriorOfAnotherShape) {
  PriorTrainingOptions options = Options("out");
  options.start = TrainPrior(options, StartFrom::kScratch, {}).model.string();
  options.encoder.channels += 1;
  EXPECT_THROW(TrainPrior(options, StartFrom::kModel, {}), Error);
}

TEST_F(PriorTrainerTest, RefusesToResumeWhatIsNotThereOrDiffers) {
  EXPECT_THROW(TrainPrior(Options("none"), StartFrom::kCheckpoint, {}), BadFile);
  TrainPrior(Options("out"), StartFrom::kScratch, {});
  PriorTrainingOptions other = Options("out");
  other.encoder.channels += 1;
  EXPECT_THROW(TrainPrior(other, StartFrom::kCheckpoint, {}), BadFile);
}

TEST_F(PriorTrainerTest, WithoutALearningRateTheBackboneStaysAsItIs) {
  const auto weights_after = [&](int iterations, double rate) {
    PriorTrainingOptions options = Options("out" + std::to_string(iterations) + std::to_string(rate));
    options.iterations = iterations;
    options.frozen_epochs = 0;
    options.backbone_learning_rate = rate;
    TrainPrior(options, StartFrom::kScratch, {});
    return SafetensorsReader(options.out / "checkpoint.safetensors").ReadAll().tensors;
  };
  const std::string backbone = "weight/backbone._blocks.9._project_conv.weight", head = "weight/project16.weight";
  const auto before = weights_after(1, 0), after = weights_after(4, 0), trained = weights_after(4, 1e-3);
  EXPECT_EQ(before.at(backbone).data, after.at(backbone).data);
  EXPECT_NE(before.at(backbone).data, trained.at(backbone).data);
  EXPECT_NE(before.at(head).data, after.at(head).data);
}

TEST_F(PriorTrainerTest, TheCacheIsRenderedOnceAndAgainWhenOptionsChange) {
  PriorTrainingOptions options = Options("out");
  const MeshCollection meshes = MeshCollection::Open(options.objects);
  const auto open = [&] { return ViewCache::OpenOrRender(options.cache, meshes, options.views, {}); };
  open();
  const auto first = fs::last_write_time(options.cache / "views.raw");
  open();
  EXPECT_EQ(fs::last_write_time(options.cache / "views.raw"), first);
  options.views.seed = 77;
  open();
  EXPECT_NE(fs::last_write_time(options.cache / "views.raw"), first);
}

TEST_F(PriorTrainerTest, AnAugmentedViewIsThatOfTheTurnedCamera) {
  // Without jitter, an augmented view must be what the renderer sees from the returned rotation: rolling
  // back the augmented image gives the cached one again.
  PriorTrainingOptions options = Options("out");
  options.views.image_size = 160;
  const ViewCache cache = ViewCache::OpenOrRender(options.cache, MeshCollection::Open(options.objects), options.views, {});
  AugmentationOptions none;
  none.crop_shift = none.crop_scale = none.mask_error_share = none.blur_share = none.compression_share = none.cut_share = 0;
  std::mt19937_64 random(1);
  const double roll = 30;
  const AugmentedView view = AugmentView(cache, 1, 2, roll, false, 128, none, random);
  const Eigen::Matrix3d difference = view.camera_from_object.rotation * cache.CameraFromObject(1, 2).rotation.transpose();
  // What is left after taking back the roll is the small look-at correction of the crop.
  EXPECT_LT(RotationAngleDeg(difference * RotationAboutZ(RadiansFromDegrees(-roll))), 8);
  EXPECT_GT(RotationAngleDeg(difference), 20);

  // The crop turns the camera about its centre and no more: the distance to the object's middle stays, and it is seen in the picture.
  EXPECT_NEAR(view.camera_from_object.translation.norm(), cache.CameraFromObject(1, 2).translation.norm(), 1e-9);
  EXPECT_LT(view.focal_length * view.camera_from_object.translation.hnormalized().norm(), 40);

  const AugmentedView mirrored = AugmentView(cache, 1, 2, roll, true, 128, none, random);
  const Eigen::Vector3d flip(-1, 1, 1);
  EXPECT_LT((mirrored.camera_from_object.translation - flip.cwiseProduct(view.camera_from_object.translation)).norm(), 1e-9);
  EXPECT_LT(AngleBetweenDeg(mirrored.camera_from_object.rotation, flip.asDiagonal() * view.camera_from_object.rotation * flip.asDiagonal()), 1e-6);
}

TEST_F(PriorTrainerTest, AugmentationCutsOffAndCompresses) {
  PriorTrainingOptions options = Options("out");
  const ViewCache cache = ViewCache::OpenOrRender(options.cache, MeshCollection::Open(options.objects), options.views, {});
  const AugmentedView plain = PlainView(cache, 1, 2, 64);
  AugmentationOptions only{.crop_shift = 0, .crop_scale = 0, .mask_error_share = 0, .blur_share = 0, .compression_share = 1, .cut_share = 0};
  std::mt19937_64 random(1);
  const AugmentedView compressed = AugmentView(cache, 1, 2, 0, false, 64, only, random);
  cv::Mat alpha, kept;
  cv::extractChannel(plain.rgba, alpha, 3);
  cv::extractChannel(compressed.rgba, kept, 3);
  EXPECT_EQ(cv::norm(alpha, kept), 0) << "a file's compression leaves the mask alone";
  EXPECT_GT(cv::norm(plain.rgba, compressed.rgba), 0);

  only.compression_share = 0;
  only.cut_share = 1;
  const AugmentedView cut = AugmentView(cache, 1, 2, 0, false, 64, only, random);
  const auto centre = [](const AugmentedView& view) { return (view.focal_length * view.camera_from_object.translation.hnormalized()).eval(); };
  EXPECT_GT((centre(cut) - centre(plain)).norm(), 1) << "the middle of what is left is not the object's";
}

TEST_F(PriorTrainerTest, BatchesDependOnSeedAndIndexOnly) {
  PriorTrainingOptions options = Options("out");
  const ViewCache cache = ViewCache::OpenOrRender(options.cache, MeshCollection::Open(options.objects), options.views, {});
  BatchLoader a(cache, 2, 3, 32, {}, 5), b(cache, 2, 3, 32, {}, 5), c(cache, 2, 3, 32, {}, 6);
  a.Get(0);
  a.Get(1);
  EXPECT_TRUE(torch::equal(a.Get(2).rgba, b.Get(2).rgba));
  EXPECT_FALSE(torch::equal(b.Get(3).rgba, c.Get(3).rgba));
}

TEST(AugmentColors, KeepsTheBackgroundWhiteAndTheShape) {
  auto rgba = torch::rand({4, 4, 8, 8});
  rgba.slice(1, 3, 4).zero_();
  const auto white = AugmentColors(rgba, 2, {}, 3);
  EXPECT_EQ(white.sizes(), (std::vector<std::int64_t>{4, 3, 8, 8}));
  EXPECT_LT((white - 1).abs().max().item<double>(), 1e-6);
  rgba.slice(1, 3, 4).fill_(1);
  EXPECT_GT((AugmentColors(rgba, 2, {}, 3) - AugmentColors(rgba, 2, {}, 4)).abs().max().item<double>(), 0.05);
}

}  // namespace
}  // namespace antipode
