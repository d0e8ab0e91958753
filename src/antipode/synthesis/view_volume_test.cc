#include "antipode/synthesis/view_volume.h"

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

const VolumeCamera kFront{{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, 4)}, 2.5};

ViewVolumeConfig Small() {
  return {.image_size = 32, .width = 16, .layers = 1, .heads = 2, .feed_forward = 16, .fine = 8, .finest = 8, .depth = 6};
}

/// Empty but for a red cube around (x, y, z), in cells of a volume of 16 a side.
torch::Tensor WithCube(int x, int y, int z) {
  torch::Tensor volume = torch::full({1, 4, 16, 16, 16}, -10.0f);
  volume.slice(2, z - 1, z + 2).slice(3, y - 1, y + 2).slice(4, x - 1, x + 2) = 10.0f;
  volume.slice(1, 1, 3) = -10.0f;
  return volume;
}

/// Mean pixel of what is opaque, -1..1.
Eigen::Vector2d MiddleOf(const torch::Tensor& alpha) {
  const std::int64_t side = alpha.size(3);
  const torch::Tensor pixel = (torch::arange(side) + 0.5) * (2.0 / static_cast<double>(side)) - 1, image = alpha[0][0];
  const double sum = image.sum().item<double>();
  return {(image * pixel.unsqueeze(0)).sum().item<double>() / sum, (image * pixel.unsqueeze(1)).sum().item<double>() / sum};
}

/// Where the camera sees a cell of a volume of 16 a side.
Eigen::Vector2d Projected(const VolumeCamera& camera, int x, int y, int z) {
  const auto coordinate = [](int cell, double extent) { return ((cell + 0.5) / 8 - 1) * extent; };
  const Eigen::Vector3d point = camera.camera_from_volume *
                                Eigen::Vector3d(coordinate(x, kVolumeExtent[0]), coordinate(y, kVolumeExtent[1]), coordinate(z, kVolumeExtent[2]));
  return camera.focal_length * point.hnormalized();
}

TEST(RenderVolumes, ShowsWhatIsDenseWhereTheCameraSeesIt) {
  const VolumeCamera turned{{RotationFromVector(Eigen::Vector3d(0.3, -1.2, 0.4)), Eigen::Vector3d(0.1, -0.1, 4)}, 2.5};
  for (const VolumeCamera& camera : {kFront, turned}) {
    const VolumeViews seen = RenderVolumes(WithCube(11, 5, 8), std::span(&camera, 1), {.image_size = 64, .samples = 64});
    EXPECT_LT((MiddleOf(seen.alpha) - Projected(camera, 11, 5, 8)).norm(), 0.03);
    EXPECT_GT(seen.alpha.max().item<double>(), 0.95);
    const torch::Tensor red = seen.rgb[0].index({torch::indexing::Slice(), seen.alpha[0][0] > 0.98}).mean(1);
    EXPECT_GT(red[0].item<double>(), 0.95);
    EXPECT_LT(red[1].item<double>(), 0.1);
  }
}

TEST(RenderVolumes, IsWhiteWhereThereIsNothing) {
  const VolumeViews seen = RenderVolumes(torch::full({1, 4, 8, 8, 8}, -10.0f), std::span(&kFront, 1), {.image_size = 16});
  EXPECT_GT(seen.rgb.min().item<double>(), 0.99);
  EXPECT_LT(seen.alpha.max().item<double>(), 0.01);
}

TEST(RenderVolumes, WhatIsNearerHidesWhatIsFarther) {
  torch::Tensor volume = WithCube(8, 8, 4);  // red, near
  volume.slice(2, 11, 14) = WithCube(8, 8, 12).slice(2, 11, 14);
  volume.slice(2, 8).slice(1, 0, 1) = -10.0f;  // black, far
  const VolumeViews seen = RenderVolumes(volume, std::span(&kFront, 1), {.image_size = 32, .samples = 64});
  EXPECT_GT(seen.rgb[0][0][16][16].item<double>(), 0.9);
}

TEST(RenderVolumes, GivesEveryVolumeItsOwnCameras) {
  const torch::Tensor volumes = torch::cat({WithCube(11, 5, 8), WithCube(4, 9, 8)});
  const std::vector<VolumeCamera> cameras(4, kFront);
  const VolumeViews seen = RenderVolumes(volumes, cameras, {.image_size = 32});
  EXPECT_EQ(seen.rgb.sizes(), (std::vector<std::int64_t>{4, 3, 32, 32}));
  EXPECT_LT((MiddleOf(seen.alpha.slice(0, 1, 2)) - Projected(kFront, 11, 5, 8)).norm(), 0.05);
  EXPECT_LT((MiddleOf(seen.alpha.slice(0, 2, 3)) - Projected(kFront, 4, 9, 8)).norm(), 0.05);
  EXPECT_THROW(RenderVolumes(volumes, std::span(cameras).first(3)), Error);
}

TEST(ViewVolume, MakesAVolumeOfAPicture) {
  torch::manual_seed(1);
  ViewVolume network(Small());
  const torch::Tensor volumes = network->forward(torch::rand({2, 3, 32, 32}));
  EXPECT_EQ(volumes.sizes(), (std::vector<std::int64_t>{2, 4, 6, 8, 8}));
  EXPECT_GT((volumes[0] - volumes[1]).abs().max().item<double>(), 1e-6);
}

TEST(ViewVolumeConfig, SurvivesMetadataAndRefusesOthers) {
  const ViewVolumeConfig config = Small(), read = ViewVolumeConfig::FromMetadata(config.ToMetadata(), "file");
  EXPECT_EQ(read.ToMetadata(), config.ToMetadata());
  EXPECT_TRUE(ViewVolumeConfig::IsIn(config.ToMetadata()));
  EXPECT_FALSE(ViewVolumeConfig::IsIn({{"architecture", "object-encoder-1"}}));
  EXPECT_THROW(ViewVolumeConfig::FromMetadata({}, "file"), BadFile);
  ViewVolumeConfig wrong = Small();
  wrong.width = 17;
  EXPECT_THROW(wrong.Check(), InvalidOption);
}

}  // namespace
}  // namespace antipode
