#include "antipode/training/volume_trainer.h"

#include <algorithm>
#include <cstddef>

#include <gtest/gtest.h>

#include "antipode/gen6d/shared_backbone.h"
#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/nn/module_weights.h"
#include "antipode/synthesis/object_centric_picture.h"
#include "antipode/synthesis/volume_synthesizer.h"
#include "antipode/training/test_objects.h"
#include "antipode/training/test_stop.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"
#include "antipode/weights/safetensors.h"

namespace antipode {
namespace {

ViewVolumeConfig TinyConfig() {
  return {.image_size = 64, .width = 32, .layers = 1, .heads = 2, .feed_forward = 32, .fine = 16, .finest = 16, .depth = 16};
}

VolumeTrainingOptions TinyTraining(const std::filesystem::path& folder) {
  WriteFileAtomically(folder / "objects" / "tetrahedron.glb", TetrahedronGlb(0.8f));
  VolumeTrainingOptions options;
  options.objects = options.validation_objects = folder / "objects";
  options.run.out = folder / "out";
  options.objects_per_step = 1;
  options.views_per_object = 6;
  options.run.learning_rate = 3e-3;
  options.run.average_decay = 0.98;
  options.rendering.image_size = 16;
  options.rendering.samples = 16;
  options.threads = 1;
  options.views.views_per_object = 12;
  options.views.variants = 1;
  options.views.image_size = 64;
  options.views.wide_share = 0;
  options.augmentation.mirror_share = 0;
  return options;
}

TEST(TrainVolume, ShowsOneObjectBetterThanItsPictureDoes) {
  const TemporaryFolder temporary;
  VolumeTrainingOptions options = TinyTraining(temporary.path());
  options.run.iterations = 150;
  options.validation_objects = temporary.path() / "pictures";  // the same object in several pictures
  for (const char* name : {"a.glb", "b.glb", "c.glb", "d.glb"}) WriteFileAtomically(options.validation_objects / name, TetrahedronGlb(0.8f));
  const VolumeTrainingResult result = TrainVolume(options, TinyConfig());
  EXPECT_EQ(result.steps, 150);
  EXPECT_LT(result.last_loss, 0.5 * result.first_loss) << result.first_loss << " to " << result.last_loss;
  RecordProperty("psnr_of_views_db", std::to_string(result.validation_db));
  EXPECT_GT(result.validation_db, result.picture_db + 0.3) << "from viewpoints that it was not trained on";
}

TEST(TrainVolume, ResumesExactly) {
  const TemporaryFolder temporary;
  VolumeTrainingOptions options = TinyTraining(temporary.path());
  options.validation_objects.clear();
  options.run.learning_rate = 1e-3;
  options.run.iterations = 4;
  const auto weights = [](const VolumeTrainingResult& result) { return SafetensorsReader(result.model / "model.safetensors").ReadAll().tensors; };
  const auto whole = weights(TrainVolume(options, TinyConfig()));

  options.run.out = temporary.path() / "parts";
  options.cache = temporary.path() / "out" / "cache";
  options.run.resume = true;
  EXPECT_THROW(TrainVolume(options, TinyConfig()), BadFile) << "nothing was saved";
  options.run.resume = false;
  options.run.minutes_between_checkpoints = 0;
  EXPECT_THROW(TrainVolume(options, TinyConfig(), StopAtStep(3)), Interrupted);
  options.run.resume = true;
  const auto again = weights(TrainVolume(options, TinyConfig()));
  for (const auto& [name, tensor] : whole) EXPECT_EQ(tensor.data, again.at(name).data) << name;
  ViewVolumeConfig other = TinyConfig();
  other.depth = 8;
  EXPECT_THROW(TrainVolume(options, other), BadFile);

  TensorFile prior = LoadModel("prior");
  for (auto& [name, tensor] : prior.tensors)
    if (IsBackbone(name)) std::fill(tensor.data.begin(), tensor.data.end(), std::byte{0});
  SaveModel(temporary.path(), "prior", prior, "A prior with another backbone", "Apache-2.0", "");
  options.prior = (temporary.path() / "prior").string();
  EXPECT_THROW(TrainVolume(options, TinyConfig()), BadFile) << "the checkpoint goes with the backbone that it was trained with";
}

TEST(VolumeCamerasOf, ShowTheMiddleOfTheObjectWhereTheyDid) {
  const std::vector<Rigid3> poses{CameraFromObject({.azimuth = 20, .elevation = 10, .distance = 3}),
                                  CameraFromObject({.azimuth = 150, .elevation = 50, .distance = 5})};
  const double focal_lengths[] = {200, 300};
  const auto cameras = VolumeCamerasOf(poses, focal_lengths, 128);
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_LT(AngleBetweenDeg(cameras[1].camera_from_volume.rotation, poses[1].rotation * poses[0].rotation.transpose()), 1e-6);
  EXPECT_LT(AngleBetweenDeg(cameras[0].camera_from_volume.rotation, Eigen::Matrix3d::Identity()), 1e-6);
  // The picture's half side is 1 + 2 margin units wide at the depth of the object's middle.
  EXPECT_NEAR(cameras[0].camera_from_volume.translation.z() / cameras[0].focal_length, 1 + 2 * kObjectCentricMargin, 1e-9);
  // A point of the object is seen where it was.
  const double unit = 3 * 64 / (1 + 2 * kObjectCentricMargin) / 200;
  const Eigen::Vector3d point(0.2, -0.3, 0.4), in_volume = (poses[0] * point - Eigen::Vector3d(0, 0, 3)) / unit;
  const Eigen::Vector2d seen = 64 * cameras[1].focal_length * (cameras[1].camera_from_volume * in_volume).hnormalized();
  EXPECT_LT((seen - 300 * (poses[1] * point).hnormalized()).norm(), 1e-9);
}

TEST(VolumeSynthesizer, ShowsTheObjectFromTheViewpointsAskedFor) {
  const TemporaryFolder temporary;
  VolumeTrainingOptions options = TinyTraining(temporary.path());
  options.run.iterations = 60;
  const VolumeTrainingResult trained = TrainVolume(options, TinyConfig());
  ASSERT_TRUE(IsViewVolume(trained.model.string()));
  cv::Mat picture(96, 96, CV_8UC3, cv::Scalar::all(255));
  picture(cv::Rect(20, 30, 50, 40)).setTo(cv::Scalar(200, 30, 30));
  const VolumeSynthesizer synthesizer(trained.model.string(), picture);
  const double elevations[] = {20}, azimuths[] = {0, 120};
  std::vector<SynthesizedView> views;
  synthesizer.Synthesize(RequestViews(elevations, azimuths, 20), [&](const SynthesizedView& view) { views.push_back(view); });
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[0].image.size(), cv::Size(96, 96));
  EXPECT_GT(cv::norm(views[0].image, views[1].image, cv::NORM_L1), 1000) << "the views differ";
  EXPECT_NE(synthesizer.Fingerprint(), VolumeSynthesizer(trained.model.string(), 255 - picture).Fingerprint());
}

}  // namespace
}  // namespace antipode
