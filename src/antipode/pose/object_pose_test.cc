#include "antipode/pose/object_pose.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/image/load.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/pose/reference_build.h"
#include "antipode/pose/view_comparison.h"
#include "antipode/synthesis/mesh_synthesizer.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

const PriorIdentity kIdentity{"weights of the test"};

ObjectPrior SmallPrior() {
  ObjectEncoderConfig config;
  config.image_size = 64;
  config.max_degree = 3;
  config.channels = 4;
  config.width = 16;
  config.layers = 1;
  config.heads = 2;
  config.feed_forward = 16;
  config.spatial_bases = 2;
  ObjectEncoder encoder(config);
  return ObjectPrior(encoder, torch::kCPU);
}

/// A box with faces of different colours and a nose.
Mesh Thing() {
  Mesh mesh;
  const std::vector<Eigen::Vector3f> corners{{-0.6f, -0.4f, -0.3f}, {0.6f, -0.4f, -0.3f}, {0.6f, 0.5f, -0.3f}, {-0.6f, 0.2f, -0.3f},
                                             {-0.6f, -0.4f, 0.3f},  {0.6f, -0.4f, 0.3f},  {0.6f, 0.5f, 0.5f},  {-0.6f, 0.2f, 0.3f}};
  const int faces[6][4] = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 4, 7, 3}, {1, 2, 6, 5}, {3, 7, 6, 2}, {0, 1, 5, 4}};
  for (int face = 0; face < 6; ++face) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const int corner : faces[face]) {
      mesh.positions.push_back(corners[corner]);
      mesh.normals.push_back(corners[corner].normalized());
    }
    for (const auto& t : {Eigen::Matrix<std::uint32_t, 3, 1>(0, 1, 2), {0, 2, 3}}) {
      mesh.triangles.push_back((t.array() + first).matrix());
      mesh.triangle_materials.push_back(static_cast<std::uint16_t>(face));
    }
    mesh.materials.push_back({Eigen::Vector3f(0.1f + 0.15f * face, 0.8f - 0.13f * face, face % 2 ? 0.1f : 0.6f), {}});
  }
  return mesh;
}

Reference ThingReference(const ObjectPrior& prior, int views = 24) {
  return BuildReference(MeshSynthesizer(Thing()), RequestViewsAllAround(views, 0), prior, kIdentity, std::nullopt);
}

ObjectPhotograph PhotographOf(const Rigid3& camera_from_object) {
  Mesh mesh = Thing();
  mesh.Normalize();
  const PinholeCamera camera = PinholeCamera::FromFieldOfView(200, 160, 45);
  const Rendering rendering = Renderer(mesh).Render(camera, camera_from_object);
  return {rendering.image, rendering.mask, camera};
}

TEST(Reference, NeedsEightViewsThatShowTheObject) {
  const ObjectPrior prior = SmallPrior();
  std::vector<SynthesizedView> views = ThingReference(prior, 9).views;
  views[4].image.setTo(cv::Scalar::all(255));
  const Reference reference = MakeReference(views, prior);
  EXPECT_EQ(reference.views.size(), 8u);
  ASSERT_EQ(reference.warnings.size(), 1u);
  EXPECT_NE(reference.warnings[0].find("shows no object"), std::string::npos);
  views[5].image.setTo(cv::Scalar::all(255));
  EXPECT_THROW(MakeReference(views, prior), Error);
}

TEST(Reference, TheJoinedCodeDoesNotDependOnTheOrderOfTheViews) {
  const ObjectPrior prior = SmallPrior();
  Reference reference = ThingReference(prior, 12);
  std::vector<SynthesizedView> reversed(reference.views.rbegin(), reference.views.rend());
  EXPECT_TRUE(torch::allclose(reference.code, MakeReference(reversed, prior).code, 1e-4, 1e-5));
}

TEST(ReferenceFolder, GivesBackWhatWasSaved) {
  const TemporaryFolder temporary;
  const ObjectPrior prior = SmallPrior();
  const Rigid3 source = CameraFromObject({.azimuth = 20, .elevation = 30, .distance = 4});
  const Reference built = BuildReference(MeshSynthesizer(Thing()), RequestViewsAllAround(10, 0), prior, kIdentity, source, temporary.path());
  const Reference loaded = LoadReference(temporary.path(), kIdentity);
  ASSERT_EQ(loaded.views.size(), built.views.size());
  EXPECT_TRUE(torch::equal(loaded.code, built.code));
  for (std::size_t i = 0; i < loaded.views.size(); ++i) {
    EXPECT_EQ(cv::norm(loaded.views[i].image, built.views[i].image, cv::NORM_INF), 0);
    EXPECT_LT((loaded.views[i].camera_from_object.Matrix() - built.views[i].camera_from_object.Matrix()).norm(), 1e-12);
  }
  ASSERT_TRUE(loaded.source_from_object);
  EXPECT_LT((loaded.source_from_object->Matrix() - source.Matrix()).norm(), 1e-12);
  EXPECT_EQ(ReadReferenceInfo(temporary.path()).views, 10);
  EXPECT_THROW(LoadReference(temporary.path(), {"other weights"}), BadFile);
}

/// What LoadReference says after `damage` was done to a folder.
std::string ComplaintAfter(const std::function<void(const std::filesystem::path&)>& damage) {
  const TemporaryFolder temporary;
  BuildReference(MeshSynthesizer(Thing()), RequestViewsAllAround(8, 0), SmallPrior(), kIdentity, std::nullopt, temporary.path());
  damage(temporary.path());
  try {
    LoadReference(temporary.path(), kIdentity);
  } catch (const BadFile& error) {
    return error.what();
  }
  return {};
}

TEST(ReferenceFolder, IsRefusedWhenDamaged) {
  const std::string view = RequestViewsAllAround(8, 0)[3].name + ".png";
  EXPECT_NE(ComplaintAfter([&](const auto& folder) { WriteFileAtomically(folder / view, "x"); }).find(view), std::string::npos);
  EXPECT_NE(ComplaintAfter([&](const auto& folder) { std::filesystem::remove(folder / view); }).find(view), std::string::npos);
  EXPECT_NE(ComplaintAfter([](const auto& folder) { WriteFileAtomically(folder / "features.safetensors", "x"); }).find("features"), std::string::npos);
  EXPECT_NE(ComplaintAfter([](const auto& folder) { WriteFileAtomically(folder / "views.json", "{}"); }).find("views.json"), std::string::npos);
  EXPECT_NE(ComplaintAfter([](const auto& folder) { std::filesystem::remove(folder / "reference.json"); }).find("no finished reference"), std::string::npos);
  EXPECT_NE(ComplaintAfter([](const auto& folder) { WriteFileAtomically(folder / "reference.json", "{"); }).find("damaged"), std::string::npos);
  EXPECT_NE(ComplaintAfter([](const auto& folder) {
              auto json = nlohmann::json::parse(ReadFile(folder / "reference.json"));
              json["format"] = 99;
              WriteFileAtomically(folder / "reference.json", json.dump());
            }).find("another version"),
            std::string::npos);
}

TEST(ReferenceFolder, GoesOnWithTheViewsThatAreThere) {
  const TemporaryFolder temporary;
  const ObjectPrior prior = SmallPrior();
  const auto requests = RequestViewsAllAround(8, 0);
  BuildReference(MeshSynthesizer(Thing()), requests, prior, kIdentity, std::nullopt, temporary.path());
  WriteFileAtomically(temporary.path() / (requests[2].name + ".png"), "damaged");
  int rendered = 0;
  BuildReference(MeshSynthesizer(Thing()), requests, prior, kIdentity, std::nullopt, temporary.path(),
                 [&](const Progress& progress) { rendered += progress.stage == "rendering views"; });
  EXPECT_EQ(rendered, 1) << "the damaged view is made again, the others are kept";
  EXPECT_NO_THROW(LoadReference(temporary.path(), kIdentity));
  MeshSynthesisOptions other;
  other.picture.azimuth = 10;
  EXPECT_THROW(BuildReference(MeshSynthesizer(Thing(), other), requests, prior, kIdentity, std::nullopt, temporary.path()), Error);
}

TEST(PlaceObject, PutsTheObjectWhereThePhotographShowsIt) {
  const ObjectPrior prior = SmallPrior();
  const Reference reference = ThingReference(prior, 96);
  for (const double azimuth : {10.0, 130.0, 250.0}) {
    const Rigid3 pose = CameraFromObject({.azimuth = azimuth, .elevation = 25, .in_plane_rotation = 15, .distance = 3.6});
    const ObjectPhotograph photograph = PhotographOf(pose);
    const ObjectView crop = MakeObjectView(photograph.image, photograph.mask, photograph.camera);
    const Rigid3 placed = PlaceObject(reference, crop, crop.crop_from_camera * pose.rotation);
    const Eigen::Vector3d found = crop.crop_from_camera.transpose() * placed.translation;
    EXPECT_LT((found - pose.translation).norm(), 0.12 * pose.translation.norm());
  }
}

TEST(NearestView, OfAViewIsItself) {
  const ObjectPrior prior = SmallPrior();
  const Reference reference = ThingReference(prior, 16);
  for (std::size_t i = 0; i < reference.views.size(); ++i) EXPECT_EQ(NearestView(reference, reference.CropRotation(i)), i);
}

TEST(ObjectPose, IsRelativeToTheSource) {
  Reference reference;
  reference.source_from_object = CameraFromObject({.azimuth = 40, .elevation = 10, .distance = 3});
  const Rigid3 query_pose = CameraFromObject({.azimuth = 100, .elevation = 30, .distance = 4});
  ObjectPose query;
  query.hypotheses = {{query_pose, 0.7, "prior"}};
  query.confidence = 0.6;
  const TwoViewPose pose = RelativeToSource(reference, query);
  const Eigen::Vector3d point(0.2, -0.1, 0.3);
  EXPECT_LT((pose.query_from_reference * (*reference.source_from_object * point) - query_pose * point).norm(), 1e-12);
  ObjectPose first;
  first.hypotheses = {{*reference.source_from_object, 0.5, "prior"}};
  first.confidence = 0.5;
  const TwoViewPose composed = ComposeObjectPoses(first, query);
  EXPECT_LT((composed.query_from_reference.Matrix() - pose.query_from_reference.Matrix()).norm(), 1e-12);
  EXPECT_NEAR(composed.confidence, 0.3, 1e-12) << "both poses must be right";
}

TEST(EstimateObjectPose, ListsPosesWhoseProbabilitiesSumToAtMostOne) {
  const ObjectPrior prior = SmallPrior();
  const Reference reference = ThingReference(prior, 12);
  const ObjectPose pose = EstimateObjectPose(reference, {.prior = &prior}, PhotographOf(CameraFromObject({.elevation = 20, .distance = 4})));
  double sum = 0;
  for (std::size_t i = 0; i < pose.hypotheses.size(); ++i) {
    sum += pose.hypotheses[i].probability;
    if (i == 0) continue;
    EXPECT_LE(pose.hypotheses[i].probability, pose.hypotheses[i - 1].probability);
  }
  EXPECT_LE(sum, 1 + 1e-9);
  EXPECT_GE(pose.confidence, 0);
  EXPECT_LE(pose.confidence, 1);
  EXPECT_THROW(EstimateObjectPose(reference, {.prior = &prior}, PhotographOf(CameraFromObject({.distance = 4})), {.hypotheses = 0, .matching = {}}), InvalidOption);
}

/// A refiner that always turns the input camera about its viewing direction.
Refiner RefinerThatTurns(double angle) {
  const torch::NoGradGuard no_gradient;
  Refiner refiner(RefinerConfig{.backbone = BackboneKind::kEfficientNetLite0, .finest_stride = 8, .feature_width = 2, .volume_width = 2, .grid = 16,
                                .regressor_width = 4});
  for (auto& parameter : refiner->parameters()) parameter.zero_();
  for (auto& item : refiner->named_parameters()) {
    if (item.key() != "regressor.fcr.bias") continue;
    item.value()[0] = std::cos(angle / 2);
    item.value()[3] = std::sin(angle / 2);
  }
  refiner->eval();
  return refiner;
}

ObjectPose PoseWithRefiner(const Reference& reference, const ObjectPrior& prior, const Refiner& refiner) {
  ViewComparison comparison(std::nullopt, refiner);
  comparison.Prepare(reference);
  return EstimateObjectPose(reference, {.prior = &prior, .comparison = &comparison}, PhotographOf(CameraFromObject({.elevation = 20, .distance = 4})),
                            {.hypotheses = 2, .matching = {}});
}

TEST(EstimateObjectPose, LetsTheRefinerChangePoses) {
  const ObjectPrior prior = SmallPrior();
  const Reference reference = ThingReference(prior, 32);
  const ObjectPose coarse = EstimateObjectPose(reference, {.prior = &prior}, PhotographOf(CameraFromObject({.elevation = 20, .distance = 4})),
                                               {.hypotheses = 2, .matching = {}});
  const ObjectPose same = PoseWithRefiner(reference, prior, RefinerThatTurns(0));
  const ObjectPose turned = PoseWithRefiner(reference, prior, RefinerThatTurns(RadiansFromDegrees(10)));
  ASSERT_EQ(same.hypotheses.size(), coarse.hypotheses.size());
  for (std::size_t i = 0; i < coarse.hypotheses.size(); ++i) {
    const Eigen::Matrix3d& before = coarse.hypotheses[i].camera_from_object.rotation;
    EXPECT_LT(AngleBetweenDeg(same.hypotheses[i].camera_from_object.rotation, before), 0.1);
    EXPECT_NEAR(AngleBetweenDeg(turned.hypotheses[i].camera_from_object.rotation, before), 30, 0.5) << "three times ten degrees";
    EXPECT_EQ(same.hypotheses[i].source, "refiner");
  }
}

TEST(EstimateObjectPose, LeavesTheRefinerOutWhereViewsAreFewAndSaysSo) {
  const ObjectPrior prior = SmallPrior();
  const Reference reference = ThingReference(prior, 12);
  const ObjectPose pose = PoseWithRefiner(reference, prior, RefinerThatTurns(RadiansFromDegrees(10)));
  for (const ObjectPoseHypothesis& hypothesis : pose.hypotheses) EXPECT_NE(hypothesis.source, "refiner");
  ASSERT_FALSE(pose.warnings.empty());
  EXPECT_NE(pose.warnings.front().find("has only 12 views"), std::string::npos) << pose.warnings.front();
}

TEST(ShippedRefiner, BringsPosesNearer) {
  const ObjectPrior prior = SmallPrior();
  const Reference reference = ThingReference(prior, 48);
  ViewComparison comparison = ViewComparison::Load("", "refiner");
  comparison.Prepare(reference);
  double before = 0, after = 0;
  for (const double azimuth : {20.0, 200.0}) {
    const Rigid3 pose = CameraFromObject({.azimuth = azimuth, .elevation = 25, .distance = 4});
    const ObjectPhotograph photograph = PhotographOf(pose);
    const ObjectView crop = MakeObjectView(photograph.image, photograph.mask, photograph.camera, {.size = 256});
    const Rigid3 truth{crop.crop_from_camera * pose.rotation, crop.crop_from_camera * pose.translation};
    const Rigid3 start{truth.rotation * RotationAboutY(RadiansFromDegrees(18)), truth.translation};
    const Rigid3 refined = comparison.Refine(crop, {start}, 3)[0].back();
    before += AngleBetweenDeg(start.rotation, truth.rotation) / 2;
    after += AngleBetweenDeg(refined.rotation, truth.rotation) / 2;
  }
  EXPECT_LT(after, 0.7 * before);
  RecordProperty("mean_error_deg", std::to_string(after));
}

}  // namespace
}  // namespace antipode
