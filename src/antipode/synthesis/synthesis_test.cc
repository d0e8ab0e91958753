#include <cmath>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/synthesis/mesh_synthesizer.h"
#include "antipode/synthesis/view_folder.h"
#include "antipode/synthesis/zero123_synthesizer.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"
#include "antipode/zero123/test_config.h"

namespace antipode {
namespace {

constexpr SynthesisCamera kCamera{.focal_length = 1.1, .distance = 3};

cv::Mat PictureWithSquare(int side) {
  cv::Mat picture(128, 128, CV_8UC3, cv::Scalar::all(255));
  picture(cv::Rect((128 - side) / 2, (128 - side) / 2, side, side)).setTo(cv::Scalar(200, 30, 30));
  return picture;
}

TEST(ViewRequests, PredefinedOnesLookAtTheObjectFromAbove) {
  const auto requests = RequestPredefinedViews(16, 20);
  ASSERT_EQ(requests.size(), 16u);
  EXPECT_NEAR(requests.front().relative.polar, 20, 1e-9) << "the first view is on the horizon, 20 degrees below the picture";
  for (const ViewRequest& request : requests) {
    const SynthesizedView view = PosedView(request, PictureWithSquare(65), kCamera);
    EXPECT_NEAR(view.camera_from_object.translation.head<2>().norm(), 0, 1e-9);
    const Eigen::Vector3d camera = view.camera_from_object.OriginInSource();
    EXPECT_NEAR(std::asin(camera.y() / camera.norm()), request.direction.elevation, 1e-9) << "+Y is up";
  }
}

TEST(ViewRequests, GridsHaveAllCombinationsAndDistinctNames) {
  const double elevations[] = {-10, 30}, azimuths[] = {0, 45.5, 90};
  const auto requests = RequestViews(elevations, azimuths, 0);
  ASSERT_EQ(requests.size(), 6u);
  EXPECT_EQ(requests[1].name, "e-10_a45.5");
  EXPECT_NEAR(requests[4].relative.polar, -30, 1e-9);
  EXPECT_NEAR(requests[4].relative.azimuth, 45.5, 1e-9);
  const double beyond[] = {95};
  EXPECT_THROW(RequestViews(beyond, azimuths, 0), InvalidOption);
  EXPECT_THROW(RequestPredefinedViews(0, 0), InvalidOption);
  EXPECT_THROW(RequestPredefinedViews(4, 95), InvalidOption);
}

TEST(ViewRequests, AllAroundCoversBothHemispheresEvenly) {
  const auto requests = RequestViewsAllAround(64, 0);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const ViewRequest& request : requests) mean += PosedView(request, PictureWithSquare(65), kCamera).camera_from_object.OriginInSource();
  EXPECT_LT(mean.norm() / 64, 0.05 * kCamera.distance);
  EXPECT_NEAR(requests.front().direction.elevation, -requests.back().direction.elevation, 1e-9);
  EXPECT_THROW(RequestViewsAllAround(0, 0), InvalidOption);
}

/// The middle of the pixels that are not white.
Eigen::Vector2d MiddleOf(const cv::Mat& picture) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x)
      if (picture.at<cv::Vec3b>(y, x) != cv::Vec3b::all(255)) sum += Eigen::Vector3d(x + 0.5, y + 0.5, 1);
  return sum.hnormalized();
}

/// A small tetrahedron far from the origin's axes and a tiny one opposite, so that both lie on the enclosing sphere.
Mesh TwoSpecks(const Eigen::Vector3f& at) {
  Mesh mesh;
  for (const float side : {1.0f, -1.0f}) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    const float size = side > 0 ? 0.08f : 0.002f;
    for (const Eigen::Vector3f& corner : {Eigen::Vector3f(1, 1, 1), {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}) {
      mesh.positions.push_back(side * at + size * corner);
      mesh.normals.push_back(corner.normalized());
    }
    for (const auto& t : {Eigen::Matrix<std::uint32_t, 3, 1>(0, 1, 2), {0, 3, 1}, {0, 2, 3}, {1, 3, 2}}) {
      mesh.triangles.push_back((t.array() + first).matrix());
      mesh.triangle_materials.push_back(0);
    }
  }
  mesh.materials.push_back({Eigen::Vector3f(0.2f, 0.2f, 0.2f), {}});
  return mesh;
}

TEST(MeshSynthesizer, ShowsPointsWhereTheCamerasOfItsViewsSeeThem) {
  Mesh mesh = TwoSpecks(Eigen::Vector3f(0.5f, 0.6f, -0.4f).normalized());
  const MeshSynthesizer synthesizer(mesh);
  mesh.Normalize();
  const Eigen::Vector3f at = (mesh.positions[0] + mesh.positions[1] + mesh.positions[2] + mesh.positions[3]) / 4;
  int seen = 0;
  synthesizer.Synthesize(RequestViewsAllAround(12, 0), [&](const SynthesizedView& view) {
    const Eigen::Vector2d expected = view.camera.Project(view.camera_from_object * at.cast<double>());
    EXPECT_LT((MiddleOf(view.image) - expected).norm(), 4) << view.request.name;
    ++seen;
  });
  EXPECT_EQ(seen, 12);
}

TEST(MeshSynthesizer, RequestsAreRelativeToItsPicture) {
  const Eigen::Vector3f at = Eigen::Vector3f(0.5f, 0.6f, -0.4f).normalized();
  MeshSynthesisOptions options;
  options.picture = {.azimuth = 40, .elevation = 25, .in_plane_rotation = 0};
  const MeshSynthesizer own(TwoSpecks(at)), relative(TwoSpecks(at), options);
  const double elevations[] = {45}, azimuths[] = {100}, relative_azimuths[] = {60};
  cv::Mat absolute_picture, relative_picture;
  own.Synthesize(RequestViews(elevations, azimuths, 0), [&](const SynthesizedView& view) { absolute_picture = view.image; });
  relative.Synthesize(RequestViews(elevations, relative_azimuths, 25), [&](const SynthesizedView& view) { relative_picture = view.image; });
  EXPECT_EQ(cv::norm(absolute_picture, relative_picture, cv::NORM_INF), 0);
  EXPECT_NE(own.Fingerprint(), relative.Fingerprint());
}

TEST(ViewFolder, KeepsWholeViewsOfTheSameSettingsOnly) {
  const TemporaryFolder temporary;
  const auto requests = RequestPredefinedViews(3, 0);
  {
    ViewFolder folder(temporary.path(), "settings");
    folder.Add(PosedView(requests[0], PictureWithSquare(65), kCamera));
    folder.Add(PosedView(requests[1], PictureWithSquare(33), {1.5, 5}));
  }
  ViewFolder folder(temporary.path(), "settings");
  ASSERT_TRUE(folder.Find(requests[0]));
  const SynthesizedView found = *folder.Find(requests[1]);
  EXPECT_NEAR(found.camera_from_object.translation.z(), 5, 1e-9);
  EXPECT_NEAR(found.camera.fx, 1.5 * 128, 1e-9);
  EXPECT_FALSE(folder.Find(requests[2]));
  WriteFileAtomically(temporary.path() / (requests[0].name + ".png"), "damaged");
  EXPECT_FALSE(folder.Find(requests[0]));
  folder.Add(PosedView(requests[2], PictureWithSquare(20), kCamera));
  const auto list = nlohmann::json::parse(ReadFile(temporary.path() / "views.json"));
  EXPECT_EQ(list.at("views").size(), 3u);
  for (const auto& view : list.at("views")) EXPECT_TRUE(view.contains("camera_from_object")) << view;
  EXPECT_THROW(ViewFolder(temporary.path(), "other settings"), Error);
  WriteFileAtomically(temporary.path() / "views.json", "{");
  EXPECT_THROW(ViewFolder(temporary.path(), "settings"), BadFile);
}

TEST(ViewFolder, TellsOtherToolsTheSameCameras) {
  const TemporaryFolder temporary;
  const ViewFolder folder(temporary.path(), "x");
  std::vector<SynthesizedView> views;
  for (const ViewRequest& request : RequestPredefinedViews(5, 0)) views.push_back(PosedView(request, PictureWithSquare(65), kCamera));
  folder.WriteOverviews(views);
  const auto transforms = nlohmann::json::parse(ReadFile(temporary.path() / "transforms.json"));
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto matrix = transforms.at("frames").at(i).at("transform_matrix");
    // OpenGL cameras look along -z: the object's centre lies there.
    const double distance = views[i].camera_from_object.translation.z();
    for (int row = 0; row < 3; ++row)
      EXPECT_NEAR(matrix[row][3].get<double>() - distance * matrix[row][2].get<double>(), 0, 1e-9);
    EXPECT_NEAR(matrix[2][3].get<double>(), distance * std::sin(views[i].request.direction.elevation), 1e-9) << "+Z is up";
  }
  EXPECT_NE(ReadFile(temporary.path() / "colmap" / "images.txt").find(views[4].request.name + ".png"), std::string::npos);
  EXPECT_EQ(ContactSheet(views).size(), cv::Size(3 * 128, 2 * 128));
}

std::filesystem::path SaveSmallModel(const std::filesystem::path& folder) {
  Zero123Config config;
  config.unet = {.base_width = 32, .multipliers = {1, 2}, .residual_blocks = 1, .attention_factors = {2}, .heads = 4, .context_width = 32};
  config.autoencoder = {.base_width = 32, .multipliers = {1, 1, 1, 1}, .residual_blocks = 1};
  config.clip = {.width = 32, .layers = 1, .heads = 2, .patch = 16, .output_width = 32, .image_size = 32};
  SaveModel(folder, "small", AllWeightsOf(SyntheticZero123(config), config), "synthetic", "none", "none");
  return folder / "small";
}

Zero123SynthesisOptions TwoSteps(int batch, double memory_limit_gb = 0) {
  return {.sampling = {.solver = Solver::kDpmSolverPlusPlus, .steps = 2, .eta = 0}, .batch = batch, .memory_limit_gb = memory_limit_gb};
}

TEST(Zero123Synthesizer, MakesThePicturesAskedForWhateverTheBatch) {
  const TemporaryFolder temporary;
  const std::string model = SaveSmallModel(temporary.path()).string();
  const auto requests = RequestPredefinedViews(3, 0);
  std::vector<std::vector<cv::Mat>> runs;
  for (const int batch : {1, 3}) {
    const Zero123Synthesizer synthesizer(model, PictureWithSquare(48), TwoSteps(batch));
    runs.emplace_back();
    synthesizer.Synthesize(requests, [&](const SynthesizedView& view) { runs.back().push_back(view.image); });
  }
  ASSERT_EQ(runs[0].size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(runs[0][i].size(), cv::Size(256, 256));
    EXPECT_LE(cv::norm(runs[0][i], runs[1][i], cv::NORM_INF), 1);
  }
  EXPECT_GT(cv::norm(runs[0][0], runs[0][1], cv::NORM_L1), 1000);
}

TEST(Zero123Synthesizer, TakesAsManyViewsAtATimeAsTheMemoryHolds) {
  const TemporaryFolder temporary;
  const std::string model = SaveSmallModel(temporary.path()).string();
  const auto requests = RequestPredefinedViews(3, 0);
  const Zero123 loaded = Zero123::Load(model);
  EXPECT_LT(MemoryForViews(loaded, 1), MemoryForViews(loaded, 2));
  const auto steps_with = [&](double limit_gb) {
    std::int64_t steps = 0;
    Zero123Synthesizer(model, PictureWithSquare(48), TwoSteps(3, limit_gb))
        .Synthesize(requests, [](const SynthesizedView&) {}, [&](const Progress& progress) { steps = std::max(steps, progress.total); });
    return steps;
  };
  const std::int64_t at_once = steps_with(1e-9 * MemoryForViews(loaded, 3));
  EXPECT_EQ(steps_with(0), at_once);
  EXPECT_EQ(steps_with(1e-9 * MemoryForViews(loaded, 1)), 3 * at_once) << "one view at a time";
  EXPECT_THROW(steps_with(0.9e-9 * MemoryForViews(loaded, 1)), Error);
}

}  // namespace
}  // namespace antipode
