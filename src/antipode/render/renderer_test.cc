#include "antipode/render/renderer.h"

#include <cmath>
#include <random>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "antipode/geometry/look_at.h"
#include "antipode/render/srgb.h"
#include "antipode/render/test_meshes.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

const PinholeCamera kCamera = PinholeCamera::FromFieldOfView(64, 64, 50);
const RenderOptions kUnlit = {.ambient = 1};

Rigid3 RandomPose(std::mt19937& generator, double distance) {
  std::uniform_real_distribution<double> azimuth(0, 360), elevation(-89, 89), roll(-180, 180);
  return CameraFromObject({azimuth(generator), elevation(generator), roll(generator), distance});
}

bool Same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

Mesh FourColorQuad(int texture_side) {
  Mesh mesh;
  mesh.materials.emplace_back();
  mesh.materials[0].texture = FourColors(texture_side);
  AddQuad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0, mesh);
  return mesh;
}

/// A box with a different texture-like colour on each face and every corner of its own colour.
Mesh ColorfulBox() {
  Mesh mesh = MakeBox({0.3f, 0.7f, 0.5f});
  for (std::size_t i = 0; i < mesh.materials.size(); ++i) {
    mesh.materials[i].base_color = Eigen::Vector3f(0.2f + 0.1f * i, 0.9f - 0.1f * i, 0.5f);
  }
  for (const auto& position : mesh.positions) {
    mesh.colors.push_back(Eigen::Vector3f::Constant(0.5f) + 0.5f * position);
  }
  return mesh;
}

TEST(Renderer, SphereHasTheSilhouetteAndDepthOfItsGeometry) {
  const float radius = 0.8f;
  const Renderer renderer(MakeSphere(radius, 128));
  std::mt19937 generator(1);
  for (int k = 0; k < 10; ++k) {
    // Off the optical axis too.
    Rigid3 pose = RandomPose(generator, 3);
    pose.translation += Eigen::Vector3d(0.1 * k - 0.5, 0.3, 0.2 * k);
    const Rendering rendering = renderer.Render(kCamera, pose);
    const Eigen::Vector3d centre = pose.translation;
    for (int i = 0; i < kCamera.height; ++i) {
      for (int j = 0; j < kCamera.width; ++j) {
        const Eigen::Vector3d ray = kCamera.Ray({j + 0.5, i + 0.5});
        const double to_centre = ray.dot(centre) / ray.squaredNorm();
        const double miss = (to_centre * ray - centre).norm();
        if (std::abs(miss - radius) < 0.05) continue;  // the edge is within this pixel
        if (miss > radius) {
          EXPECT_EQ(rendering.mask.at<std::uint8_t>(i, j), 0);
          EXPECT_EQ(rendering.depth.at<float>(i, j), 0);
          EXPECT_EQ(rendering.image.at<cv::Vec3b>(i, j), cv::Vec3b(255, 255, 255));
          continue;
        }
        const double half_chord = std::sqrt(radius * radius - miss * miss) / ray.norm();
        EXPECT_EQ(rendering.mask.at<std::uint8_t>(i, j), 255);
        EXPECT_NEAR(rendering.depth.at<float>(i, j), to_centre - half_chord, 2e-3);
      }
    }
  }
}

TEST(Renderer, CoverageAddsUpToTheAreaOfTheSilhouette) {
  const Renderer renderer(FourColorQuad(8));
  for (int samples = 1; samples <= 5; ++samples) {
    const double depth = 3.3;
    const Rendering rendering = renderer.Render(kCamera, CameraFromObject({.distance = depth}),
                                                {.samples_per_side = samples});
    const double side = 2 * kCamera.fx / depth;
    const double covered = cv::sum(rendering.mask)[0] / 255;
    // Each edge may be wrong by half a sample.
    EXPECT_NEAR(covered, side * side, 2 * side / samples + 1) << samples;
  }
}

TEST(Renderer, BoxCornersAreWhereTheyProject) {
  const Mesh box = MakeBox({0.3f, 0.7f, 0.5f});
  const Renderer renderer(box);
  std::mt19937 generator(2);
  for (int k = 0; k < 50; ++k) {
    const Rigid3 pose = RandomPose(generator, 3);
    const cv::Rect mask_box =
        cv::boundingRect(renderer.Render(kCamera, pose, {.samples_per_side = 8}).mask);
    Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
    for (const auto& position : box.positions) {
      const Eigen::Vector2d pixel =
          kCamera.Project(pose * Eigen::Vector3d(position.cast<double>()));
      low = low.cwiseMin(pixel);
      high = high.cwiseMax(pixel);
    }
    // A sharp corner may slip between the samples.
    EXPECT_NEAR(mask_box.x, low.x(), 1.3);
    EXPECT_NEAR(mask_box.y, low.y(), 1.3);
    EXPECT_NEAR(mask_box.br().x, high.x(), 1.3);
    EXPECT_NEAR(mask_box.br().y, high.y(), 1.3);
  }
}

TEST(Renderer, DepthLiftsPixelsOntoTheSurface) {
  const Eigen::Vector3d half(0.3, 0.7, 0.5);
  const Renderer renderer(MakeBox(half.cast<float>()));
  std::mt19937 generator(3);
  int seen = 0;
  for (int k = 0; k < 20; ++k) {
    const Rigid3 pose = RandomPose(generator, 2.5);
    const Rendering rendering = renderer.Render(kCamera, pose);
    for (int i = 0; i < kCamera.height; ++i) {
      for (int j = 0; j < kCamera.width; ++j) {
        const float depth = rendering.depth.at<float>(i, j);
        if (depth == 0) continue;
        ++seen;
        const Eigen::Vector3d point = pose.Inverse() * (depth * kCamera.Ray({j + 0.5, i + 0.5}));
        EXPECT_NEAR((point.cwiseAbs() - half).maxCoeff(), 0, 1e-5);
      }
    }
  }
  EXPECT_GT(seen, 5000);
}

TEST(Renderer, FourColorsAreInTheirPlaces) {
  for (const int texture_side : {16, 512}) {
    const Renderer renderer(FourColorQuad(texture_side));
    const cv::Mat image = renderer.Render(kCamera, CameraFromObject({.distance = 3}), kUnlit).image;
    EXPECT_EQ(image.at<cv::Vec3b>(24, 24), kRed);
    EXPECT_EQ(image.at<cv::Vec3b>(24, 40), kGreen);
    EXPECT_EQ(image.at<cv::Vec3b>(40, 24), kBlue);
    EXPECT_EQ(image.at<cv::Vec3b>(40, 40), kYellow);
    // From behind, left and right change places.
    const cv::Mat back =
        renderer.Render(kCamera, CameraFromObject({.azimuth = 180, .distance = 3}), kUnlit).image;
    EXPECT_EQ(back.at<cv::Vec3b>(24, 24), kGreen);
    EXPECT_EQ(back.at<cv::Vec3b>(40, 40), kBlue);
  }
}

TEST(Renderer, TextureRepeatsOutsideTheUnitSquare) {
  Mesh shifted = FourColorQuad(16);
  for (auto& texcoord : shifted.texcoords) texcoord += Eigen::Vector2f(-3, 5);
  const Rigid3 pose = CameraFromObject({.azimuth = 10, .distance = 3});
  const cv::Mat expected = Renderer(FourColorQuad(16)).Render(kCamera, pose).image;
  EXPECT_LE(cv::norm(Renderer(shifted).Render(kCamera, pose).image, expected, cv::NORM_INF), 1);
}

TEST(Renderer, UprightObjectIsUprightFromEveryElevation) {
  Mesh mesh = MakeBox({0.2f, 0.7f, 0.2f});
  // Upper end red, lower end blue.
  for (const auto& position : mesh.positions) {
    mesh.colors.push_back(position.y() > 0 ? Eigen::Vector3f(1, 0, 0) : Eigen::Vector3f(0, 0, 1));
  }
  const Renderer renderer(mesh);
  for (double elevation = -60; elevation <= 60; elevation += 20) {
    const cv::Mat image =
        renderer.Render(kCamera, CameraFromObject({.elevation = elevation, .distance = 3}), kUnlit)
            .image;
    const cv::Vec3b above = image.at<cv::Vec3b>(28, 32), below = image.at<cv::Vec3b>(36, 32);
    EXPECT_GT(above[0], below[0]) << elevation;
    EXPECT_LT(above[2], below[2]) << elevation;
  }
}

TEST(Renderer, UnlitColorIsTheTextureExactly) {
  Mesh mesh = FourColorQuad(2);
  for (int level = 0; level < 256; ++level) {
    mesh.materials[0].texture = cv::Mat(4, 4, CV_8UC3, cv::Scalar(level, 255 - level, level / 2));
    const cv::Mat image =
        Renderer(mesh).Render(kCamera, CameraFromObject({.distance = 3}), kUnlit).image;
    ASSERT_EQ(image.at<cv::Vec3b>(32, 20), cv::Vec3b(level, 255 - level, level / 2));
  }
}

TEST(Renderer, ShadesByLambertInLinearLight) {
  Mesh mesh = FourColorQuad(2);
  mesh.materials[0] = {.base_color = {0.5f, 0.25f, 0.75f}, .texture = {}};
  mesh.colors.assign(4, Eigen::Vector3f(0.5f, 1, 1));
  const Renderer renderer(mesh);
  for (const double angle : {0., 30., 60., 120.}) {
    for (const double azimuth : {0., 180.}) {  // the back is lit as the front is
      RenderOptions options{.ambient = 0.3f, .light_color = {1, 0.8f, 0.9f}};
      options.light_in_camera =
          7 * Eigen::Vector3f(std::sin(angle * M_PI / 180), 0, -std::cos(angle * M_PI / 180));
      const cv::Mat image =
          renderer.Render(kCamera, CameraFromObject({.azimuth = azimuth, .distance = 3}), options)
              .image;
      const double light = 0.3 + 0.7 * std::max(0., std::cos(angle * M_PI / 180));
      const Eigen::Vector3d expected = light * Eigen::Vector3d(0.25 * 1, 0.25 * 0.8, 0.75 * 0.9);
      for (int c = 0; c < 3; ++c) {
        const double encoded = 255 * SrgbFromLinear(static_cast<float>(expected[c]));
        EXPECT_NEAR(image.at<cv::Vec3b>(30, 20)[c], encoded, 0.6);
      }
    }
  }
}

TEST(Renderer, LightFromTheLeftBrightensTheLeftAndFromAboveTheTop) {
  const Renderer renderer(MakeSphere(1));
  std::mt19937 generator(4);
  for (int k = 0; k < 10; ++k) {
    const Rigid3 pose = RandomPose(generator, 3);
    const cv::Mat left = renderer.Render(kCamera, pose, {.light_in_camera = {-1, 0, -0.2f}}).image;
    EXPECT_GT(left.at<cv::Vec3b>(32, 16)[0], left.at<cv::Vec3b>(32, 48)[0] + 30);
    const cv::Mat top = renderer.Render(kCamera, pose, {.light_in_camera = {0, -1, -0.2f}}).image;
    EXPECT_GT(top.at<cv::Vec3b>(16, 32)[0], top.at<cv::Vec3b>(48, 32)[0] + 30);
  }
}

TEST(Renderer, MirroredMeshSeenByTheMirroredCameraGivesTheMirroredImage) {
  const Mesh mesh = ColorfulBox();
  const Renderer renderer(mesh), mirrored(MirroredX(mesh));
  const Eigen::Matrix3d flip = Eigen::Vector3d(-1, 1, 1).asDiagonal();
  std::mt19937 generator(5);
  for (int k = 0; k < 20; ++k) {
    const Rigid3 pose = RandomPose(generator, 2.7);
    const Rigid3 mirrored_pose{flip * pose.rotation * flip, flip * pose.translation};
    RenderOptions options, mirrored_options;
    mirrored_options.light_in_camera = flip.cast<float>() * options.light_in_camera;
    const Rendering a = renderer.Render(kCamera, pose, options);
    Rendering b = mirrored.Render(kCamera, mirrored_pose, mirrored_options);
    cv::flip(b.image, b.image, 1);
    cv::flip(b.mask, b.mask, 1);
    // Rays that graze an edge may fall to either side of it.
    EXPECT_LT(cv::norm(a.mask, b.mask, cv::NORM_L1) / 255, 3);
    EXPECT_LT(cv::norm(a.image, b.image, cv::NORM_L1) / (255 * 3), 3);
  }
}

TEST(Renderer, TurningTheCameraAboutItsAxisTurnsTheImage) {
  const Renderer renderer(ColorfulBox());
  std::mt19937 generator(6);
  for (int k = 0; k < 10; ++k) {
    const Rigid3 pose = RandomPose(generator, 2.7);
    Eigen::Matrix3d quarter;
    quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;  // right goes down: clockwise
    const Rigid3 turned{quarter * pose.rotation, quarter * pose.translation};
    cv::Mat expected;
    cv::rotate(renderer.Render(kCamera, pose, kUnlit).image, expected, cv::ROTATE_90_CLOCKWISE);
    EXPECT_LT(cv::norm(renderer.Render(kCamera, turned, kUnlit).image, expected, cv::NORM_L1) / 765,
              3);
  }
}

TEST(Renderer, ConcurrentRenderingsAreIdentical) {
  const Renderer renderer(ColorfulBox());
  std::vector<Rigid3> poses;
  std::mt19937 generator(7);
  for (int k = 0; k < 40; ++k) poses.push_back(RandomPose(generator, 2.7));
  const auto render_all = [&] {
    std::vector<Rendering> renderings;
    for (const Rigid3& pose : poses) renderings.push_back(renderer.Render(kCamera, pose));
    return renderings;
  };
  const auto expected = render_all();
  std::vector<std::vector<Rendering>> found(4);
  std::vector<std::thread> threads;
  for (auto& renderings : found) threads.emplace_back([&] { renderings = render_all(); });
  for (auto& thread : threads) thread.join();
  for (const auto& renderings : found) {
    for (std::size_t k = 0; k < poses.size(); ++k) {
      EXPECT_TRUE(Same(renderings[k].image, expected[k].image));
      EXPECT_TRUE(Same(renderings[k].mask, expected[k].mask));
      EXPECT_TRUE(Same(renderings[k].depth, expected[k].depth));
    }
  }
}

TEST(Renderer, MaskAloneIsTheMaskOfOneSample) {
  const Renderer renderer(ColorfulBox());
  std::mt19937 generator(8);
  for (const auto& [width, height] : {std::pair(64, 64), std::pair(37, 50), std::pair(5, 3)}) {
    const auto camera = PinholeCamera::FromFieldOfView(width, height, 40);
    for (int k = 0; k < 10; ++k) {
      const Rigid3 pose = RandomPose(generator, 2.2);
      const Rendering rendering = renderer.Render(camera, pose, {.samples_per_side = 1});
      EXPECT_TRUE(Same(renderer.RenderMask(camera, pose), rendering.mask));
      EXPECT_TRUE(Same(rendering.depth > 0, rendering.mask));
    }
  }
}

TEST(Renderer, SharpTextureFarAwayIsAveragedNotAliased) {
  Mesh mesh = FourColorQuad(2);
  cv::Mat& board = mesh.materials[0].texture;
  board.create(512, 512, CV_8UC3);
  for (int i = 0; i < 512; ++i) {
    for (int j = 0; j < 512; ++j) board.at<cv::Vec3b>(i, j) = cv::Vec3b::all((i + j) % 2 * 255);
  }
  const auto camera = PinholeCamera::FromFieldOfView(48, 48, 50);
  const cv::Mat image =
      Renderer(mesh).Render(camera, CameraFromObject({.distance = 3}), kUnlit).image;
  const int half = static_cast<int>(std::lround(255 * SrgbFromLinear(0.5f)));
  for (int i = 14; i < 34; ++i) {
    for (int j = 14; j < 34; ++j) EXPECT_NEAR(image.at<cv::Vec3b>(i, j)[0], half, 1);
  }
}

TEST(Renderer, ObjectAroundOrBehindTheCamera) {
  const Renderer renderer(MakeSphere(1));
  const Rendering inside = renderer.Render(kCamera, {});
  EXPECT_EQ(cv::countNonZero(inside.mask), kCamera.width * kCamera.height);
  EXPECT_NEAR(inside.depth.at<float>(32, 32), 1, 1e-2);
  const Rendering behind =
      renderer.Render(kCamera, {Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, -3)});
  EXPECT_EQ(cv::countNonZero(behind.mask), 0);
  const Rendering aside =
      renderer.Render(kCamera, {Eigen::Matrix3d::Identity(), Eigen::Vector3d(900, 0, 3)});
  EXPECT_EQ(cv::countNonZero(aside.mask), 0);
}

TEST(Renderer, RefusesImpossibleInput) {
  Mesh broken = MakeBox({1, 1, 1});
  broken.triangles[0][0] = 999;
  EXPECT_THROW(Renderer{broken}, Error);
  const Renderer renderer(MakeBox({1, 1, 1}));
  const Rigid3 pose = CameraFromObject({.distance = 4});
  EXPECT_THROW(renderer.Render(PinholeCamera{}, pose), InvalidOption);
  Rigid3 no_pose = pose;
  no_pose.translation.x() = NAN;
  EXPECT_THROW(renderer.Render(kCamera, no_pose), InvalidOption);
  no_pose = pose;
  no_pose.rotation *= 2;
  EXPECT_THROW(renderer.RenderMask(kCamera, no_pose), InvalidOption);
  EXPECT_THROW(renderer.Render(kCamera, pose, {.samples_per_side = 0}), InvalidOption);
  EXPECT_THROW(renderer.Render(kCamera, pose, {.ambient = 1.5f}), InvalidOption);
  EXPECT_THROW(renderer.Render(kCamera, pose, {.light_in_camera = {0, 0, 0}}), InvalidOption);
  EXPECT_THROW(renderer.Render(kCamera, pose, {.light_color = {-1, 0, 0}}), InvalidOption);
}

}  // namespace
}  // namespace antipode
