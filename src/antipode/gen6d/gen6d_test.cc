#include <algorithm>
#include <random>
#include <span>

#include <gtest/gtest.h>

#include "antipode/gen6d/gen6d_weights.h"
#include "antipode/gen6d/losses.h"
#include "antipode/gen6d/normalized_view.h"
#include "antipode/gen6d/view_set.h"
#include "antipode/geometry/rotation.h"
#include "antipode/geometry/viewpoints.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/weights/check.h"

namespace antipode {
namespace {

std::string FingerprintOf(const torch::nn::Module& network) {
  std::vector<std::string> lines;
  for (const auto& [name, tensor] : WeightsOf(network).tensors) lines.push_back(name + " " + ShapeText(tensor.shape));
  std::ranges::sort(lines);
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return std::to_string(lines.size()) + " " + Sha256Hex(std::as_bytes(std::span(text)));
}

SelectorConfig SmallSelector() {
  return {.backbone = BackboneKind::kEfficientNetLite0, .correlation_width = 8, .width = 32, .heads = 4};
}

RefinerConfig SmallRefiner() {
  return {.backbone = BackboneKind::kEfficientNetLite0, .finest_stride = 8, .feature_width = 8, .volume_width = 4, .grid = 8,
          .regressor_width = 16};
}

Rigid3 RandomLookingPose(std::mt19937_64& random) {
  std::uniform_real_distribution<double> distance(2.5, 6), beside(-0.3, 0.3);
  return {RandomRotation(random), {beside(random), beside(random), distance(random)}};
}

Eigen::Matrix3d Intrinsics(double focal_length, double centre) {
  Eigen::Matrix3d k;
  k << focal_length, 0, centre, 0, focal_length, centre, 0, 0, 1;
  return k;
}

TEST(Gen6d, HasTheTensorsOfThePublishedCheckpoints) {
  EXPECT_EQ(FingerprintOf(*Selector()), "124 a2d34b14deb79826b2c155b1a070cc4f325bf275063b391b93f99d6e3dbb4589");
  EXPECT_EQ(FingerprintOf(*Refiner()), "96 b08f0788515704182828aacffb4a3d8061e528c5ff23fbc1b4b960c82d394675");
}

TEST(NormalizedView, LooksAtTheObjectAndKeepsItsSize) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 50; ++i) {
    const Rigid3 pose = RandomLookingPose(random);
    const NormalizedView view = NormalizeUpright(Intrinsics(300, 128), pose);
    const Eigen::Vector3d centre = view.camera_from_object.translation;
    EXPECT_NEAR(centre.head<2>().norm(), 0, 1e-12) << "the object's centre is on the optical axis";
    EXPECT_NEAR(view.intrinsics(0, 0) * 2 / centre.z(), 128 * 0.95, 1e-9) << "its diameter spans 95 % of the picture";
    const Eigen::Vector3d up = view.camera_from_object.rotation.col(2);
    if (up.head<2>().norm() > 0.7) {
      EXPECT_LT(std::abs(DegreesFromRadians(std::atan2(up.x(), -up.y()))), 8) << "its z axis points up, before the look-at turn";
    }
    const Eigen::Vector3d point = pose * Eigen::Vector3d(0.3, -0.2, 0.4);
    const Eigen::Vector2d pixel = (Intrinsics(300, 128) * point).hnormalized();
    const Eigen::Vector2d expected = (view.intrinsics * (view.camera_from_object * Eigen::Vector3d(0.3, -0.2, 0.4))).hnormalized();
    EXPECT_LT(((view.normalized_pixel_from_pixel * pixel.homogeneous()).hnormalized() - expected).norm(), 1e-9);
  }
}

TEST(NormalizedView, ThePublishedFormLooksBesideObjectsFarFromTheAxis) {
  const Rigid3 pose{Eigen::Matrix3d::Identity(), {1.5, 1.5, 3}};
  NormalizationOptions published;
  published.look_at = LookAtForm::kPublished;
  const Eigen::Vector3d beside = NormalizeUnrotated(Intrinsics(300, 128), pose, published).camera_from_object.translation;
  EXPECT_NEAR(DegreesFromRadians(std::atan2(beside.head<2>().norm(), beside.z())), 2.5, 0.1);
}

TEST(NormalizedView, AlignedPicturesDifferByNoInPlaneRotation) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 50; ++i) {
    const Rigid3 first = RandomLookingPose(random), second = RandomLookingPose(random);
    const NormalizedView aligned = NormalizeAligned(Intrinsics(250, 128), first, Intrinsics(300, 100), second);
    const auto left = InPlaneDifferenceOf(aligned.intrinsics, aligned.camera_from_object, Intrinsics(300, 100), second);
    EXPECT_NEAR(left.angle, 0, 1e-9);
  }
}

TEST(QueryCrop, IsCentredAndFillsTheCropAsReferencesDo) {
  const published::InclusiveBox box{40, 60, 139, 119};
  const QueryCrop crop = CentredQueryCrop(box);
  EXPECT_EQ(crop.position, Eigen::Vector2d(89.5, 89.5));
  EXPECT_NEAR(100 / crop.scale, 121.6, 1e-9);
  const QueryCrop published = PublishedQueryCrop(box, 180);
  EXPECT_GT((published.position - crop.position).norm(), 5) << "the published crop is biased";
}

TEST(SelectedView, GivesBackTheViewsOwnPose) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> angle(-1.5, 1.5), focal_length(150, 500);
  for (int i = 0; i < 50; ++i) {
    const Rigid3 pose = RandomLookingPose(random);
    const Eigen::Matrix3d k = Intrinsics(focal_length(random), 120);
    const NormalizedView view = NormalizeUpright(k, pose);
    const auto difference = InPlaneDifferenceOf(view.intrinsics, view.camera_from_object, k, pose);
    const QueryCrop crop{(k * pose.translation).hnormalized(), difference.scale};
    const Rigid3 found = PoseFromSelectedView(crop, difference.angle, view.camera_from_object, view.intrinsics, k);
    EXPECT_LT(AngleBetweenDeg(found.rotation, pose.rotation), 1e-6);
    EXPECT_LT((found.translation - pose.translation).norm(), 1e-9);
  }
}

TEST(PoseChange, LeadsFromTheInputToTheQuery) {
  std::mt19937_64 random(4);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Matrix3d k = Intrinsics(300, 64);
    const NormalizedView input = NormalizeUnrotated(k, RandomLookingPose(random));
    const Rigid3 query = RandomLookingPose(random);
    const PoseChange change = ChangeBetween(input.intrinsics, input.camera_from_object, input.intrinsics, query);
    const Rigid3 found = ApplyChange(change, input.camera_from_object);
    EXPECT_LT(AngleBetweenDeg(found.rotation, query.rotation), 1e-6);
    EXPECT_LT((found.translation - query.translation).norm(), 1e-9);
    const Eigen::Matrix<double, 3, 4> similarity = SimilarityOf(change, input.camera_from_object);
    const Eigen::Vector3d seen = similarity * (input.camera_from_object * Eigen::Vector3d(0.1, 0.2, -0.3)).homogeneous();
    const Eigen::Vector3d expected = change.scale * (found * Eigen::Vector3d(0.1, 0.2, -0.3));
    EXPECT_LT((seen.head<2>() - expected.head<2>()).norm(), 1e-9) << "similarity and rigid pose show the same picture";
  }
}

TEST(NearestViews, AreSortedByDirectionAndThePublishedPoolLosesOne) {
  std::vector<Rigid3> views;
  for (const auto& direction : PredefinedViewpoints(16)) views.push_back(CameraFromCanonical(direction, 3));
  for (std::size_t i = 0; i < views.size(); ++i) EXPECT_EQ(NearestViews(views, views[i], 3).front(), i);
  EXPECT_EQ(NearestViews(views, views[0], 99).size(), 16u);
  EXPECT_EQ(NearestViews(views, views[0], 99, NeighbourPool::kPublished).size(), 15u);
}

TEST(Selector, LogitsFollowTheOrderOfTheViews) {
  const torch::InferenceMode inference;
  Selector selector(SmallSelector());
  FillSynthetic(*selector);
  const std::int64_t views = 4;
  const auto images = torch::sigmoid(SyntheticUniform("views", {views * Selector::Impl::kAngles, 3, 128, 128}).to(torch::kFloat));
  const auto query = torch::sigmoid(SyntheticUniform("query", {2, 3, 128, 128}).to(torch::kFloat));
  const auto viewpoints = SyntheticUniform("viewpoints", {views, 3}).to(torch::kFloat);
  const SelectorFeatures features = selector->Features(images);
  const auto order = torch::tensor({2, 0, 3, 1}, torch::kLong);
  SelectorFeatures shuffled;
  for (const auto& level : features) {
    const auto by_view = level.view({views, Selector::Impl::kAngles, level.size(1), level.size(2), level.size(3)});
    shuffled.push_back(by_view.index_select(0, order).flatten(0, 1));
  }
  const SelectorOutput straight = selector->forward(selector->Features(query), features, viewpoints);
  const SelectorOutput mixed = selector->forward(selector->Features(query), shuffled, viewpoints.index_select(0, order));
  EXPECT_EQ(straight.logits.sizes(), torch::IntArrayRef({2, views}));
  const auto largest = [](const torch::Tensor& difference) { return difference.abs().max().item<double>(); };
  EXPECT_LT(largest(straight.logits.index_select(1, order) - mixed.logits), 0.1 * straight.logits.std().item<double>());
  EXPECT_LT(largest(straight.angles.index_select(1, order) - mixed.angles), 0.1 * straight.angles.std().item<double>());
}

TEST(Selector, ViewpointsAreUnitVectorsWithTheForwardCameraInFront) {
  std::vector<Eigen::Vector3d> centres;
  for (const auto& direction : PredefinedViewpoints(8)) centres.push_back(CameraFromCanonical(direction, 2.5).OriginInSource());
  const auto vectors = ViewpointVectors(centres, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ(), 3);
  EXPECT_TRUE(torch::allclose(vectors.norm(2, 1), torch::ones({8})));
  EXPECT_NEAR(vectors[3][1].item<double>(), 0, 1e-6);
  EXPECT_GT(vectors[3][0].item<double>(), 0);
}

TEST(Refiner, AnswersWithAUnitQuaternionForEveryQueryOfTheBatch) {
  const torch::InferenceMode inference;
  Refiner refiner(SmallRefiner());
  FillSynthetic(*refiner);
  const auto images = torch::sigmoid(SyntheticUniform("images", {8, 3, 128, 128}).to(torch::kFloat));
  const auto features = refiner->Features(images);
  std::mt19937_64 random(5);
  std::vector<PosedCamera> inputs, references;
  for (int i = 0; i < 2; ++i) {
    const NormalizedView view = NormalizeUnrotated(Intrinsics(300, 64), RandomLookingPose(random));
    inputs.push_back({view.intrinsics, view.camera_from_object});
  }
  for (int i = 0; i < 6; ++i) references.push_back(inputs[i % 2]);
  const auto some = features.slice(0, 2, 8);
  const RefinerOutput both = refiner->forward(features.slice(0, 0, 2), inputs, torch::stack({some, some}), {references, references});
  EXPECT_TRUE(torch::allclose(both.rotation.norm(2, 1), torch::ones({2})));
  const RefinerOutput one = refiner->forward(features.slice(0, 1, 2), {inputs[1]}, some.unsqueeze(0), {references});
  EXPECT_TRUE(torch::allclose(both.rotation[1], one.rotation[0], 1e-3, 1e-4)) << "the batch does not matter";
  EXPECT_TRUE(torch::allclose(both.offset[1], one.offset[0], 1e-3, 1e-4));
}

TEST(Refiner, PointsOutsideThePictureHaveNoFeatures) {
  const auto features = torch::ones({2, 16, 16});
  const PosedCamera camera{Intrinsics(100, 63.5), {Eigen::Matrix3d::Identity(), {0, 0, 3}}};
  const auto points = torch::tensor({{0.f, 0.f, 0.f}, {9.f, 0.f, 0.f}});
  const auto sampled = SampleFeatures(features, camera, points, 128);
  EXPECT_NEAR(sampled[0][0].item<double>(), 1, 1e-6);
  EXPECT_EQ(sampled[0][1].item<double>(), 0);
}

TEST(Losses, VanishAtTheTruth) {
  const auto scores = torch::tensor({{0.1, 0.9, 0.5}});
  const auto right = torch::tensor({{-9.0, 9.0, 0.0}}), wrong = torch::tensor({{9.0, -9.0, 0.0}});
  EXPECT_LT(ViewSelectionLoss(right, scores).item<double>(), ViewSelectionLoss(wrong, scores).item<double>());
  const auto angle = torch::tensor({0.7});
  EXPECT_NEAR(InPlaneAngleLoss(torch::tensor({{0.0, 0.7 * 2 / M_PI}}), angle, torch::tensor({1}, torch::kLong)).item<double>(), 0, 1e-12);
  const RefinerOutput still{torch::tensor({{1.0, 0.0, 0.0, 0.0}}), torch::zeros({1, 2}), torch::zeros({1, 1})};
  const auto identity = torch::eye(4, torch::kFloat).slice(0, 0, 3).unsqueeze(0);
  EXPECT_NEAR(PoseChangeLoss(still, torch::rand({1, 7, 3}), torch::rand({1, 3}), identity).item<double>(), 0, 1e-10);
}

TEST(Gen6dImport, TakesPublishedNamesAndKnowsTheConfiguration) {
  Selector selector;
  FillSynthetic(*selector);
  TensorFile checkpoint;
  for (const auto& [name, tensor] : WeightsOf(*selector).tensors) checkpoint.tensors["network_state_dict." + name] = tensor;
  checkpoint.tensors["step"] = HostTensor::FromFloat({1}, std::vector<float>{5});
  const TensorFile imported = Gen6dSelectorWeights(checkpoint, "model_best.pth");
  EXPECT_EQ(SelectorConfig::FromMetadata(imported.metadata, "x").ToMetadata(), SelectorConfig().ToMetadata());
  EXPECT_EQ(imported.tensors.size(), 124u);
}

TEST(Gen6dImport, NamesTheFamilyOfAnotherCheckpoint) {
  const auto message = [](const char* tensor) -> std::string {
    TensorFile file;
    file.tensors[tensor] = HostTensor::FromFloat({1}, std::vector<float>{1});
    try {
      Gen6dSelectorWeights(file, "given.pth");
    } catch (const BadFile& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_NE(message("network_state_dict.volume_net.conv0.0.bias").find("the refiner of Gen6D"), std::string::npos);
  EXPECT_NE(message("model.diffusion_model.out.2.bias").find("a diffusion model"), std::string::npos);
  EXPECT_NE(message("anything").find("no checkpoint of"), std::string::npos);
}

TEST(ViewMatchingInputs, EveryViewComesInFiveTurns) {
  PosedPicture view{cv::Mat(256, 256, CV_8UC3, cv::Scalar::all(255)), Intrinsics(280, 127.5), {Eigen::Matrix3d::Identity(), {0, 0, 2.7}}};
  view.rgb(cv::Rect(120, 60, 16, 60)).setTo(cv::Scalar(10, 20, 30));
  const NormalizedView upright = NormalizeUnrotated(view.intrinsics, view.camera_from_object);
  const auto turned = TurnedPictures(view, upright, {});
  ASSERT_EQ(turned.size(), 5u);
  cv::Mat quarter;
  cv::rotate(turned[2], quarter, cv::ROTATE_90_CLOCKWISE);
  // Turning about the corner of four pixels moves a picture with centres at integers by one row or column.
  cv::Mat expected = quarter(cv::Rect(0, 0, 127, 127)), found = turned[4](cv::Rect(1, 0, 127, 127));
  EXPECT_LT(cv::norm(expected, found, cv::NORM_L1) / (127 * 127 * 3), 1.0) << "positive angles turn clockwise";
}

}  // namespace
}  // namespace antipode
