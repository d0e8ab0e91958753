#include "antipode/pose/object_pose.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/image/load.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/pose/reference_build.h"
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

}  // namespace
}  // namespace antipode
