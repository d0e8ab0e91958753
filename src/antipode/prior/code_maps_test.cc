#include "antipode/prior/code_maps.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/prior/correlation.h"

namespace antipode {
namespace {

constexpr int kDegree = 4;
constexpr int kCoefficients = (kDegree + 1) * (kDegree + 1);

torch::Tensor RandomCodes(int count, int channels) {
  torch::manual_seed(1);
  return torch::randn({count, channels, kCoefficients});
}

TEST(ScaledCodes, HaveAMeanSquareOfOneOnTheSphere) {
  torch::Tensor constant = torch::zeros({1, 2, kCoefficients});
  constant.slice(2, 0, 1).fill_(7);
  const std::vector<Eigen::Matrix3d> same{Eigen::Matrix3d::Identity()};
  const torch::Tensor maps = CodeMaps(constant, same, 8);
  EXPECT_EQ(maps.sizes(), torch::IntArrayRef({1, 4, 8, 8}));
  EXPECT_TRUE(torch::allclose(maps, torch::ones_like(maps), 1e-4, 1e-5));
}

TEST(CodeMaps, ShowTheNearHalfAndTheFarHalf) {
  torch::Tensor height = torch::zeros({1, 1, kCoefficients});
  height[0][0][2] = 1;  // Y_10, along z: grows away from the camera
  const std::vector<Eigen::Matrix3d> same{Eigen::Matrix3d::Identity()};
  const torch::Tensor maps = CodeMaps(height, same, 9);
  const float middle = std::sqrt(3.f);  // of sqrt(3) z
  EXPECT_NEAR(maps[0][0][4][4].item<float>(), -middle, 1e-4);
  EXPECT_NEAR(maps[0][1][4][4].item<float>(), middle, 1e-4);
  EXPECT_NEAR(maps[0][0][0][0].item<float>(), 0, 1e-4) << "the corner shows the outline";
}

TEST(CodeMaps, OfAnotherCameraAreThoseOfTheTurnedCode) {
  const torch::Tensor codes = RandomCodes(2, 3);
  const std::vector<Eigen::Matrix3d> turns{RotationAboutY(0.7) * RotationAboutX(-0.4), RotationAboutZ(2) * RotationAboutX(1)};
  const std::vector<Eigen::Matrix3d> same(2, Eigen::Matrix3d::Identity());
  const torch::Tensor turned = torch::stack({TurnCode(codes[0], turns[0]), TurnCode(codes[1], turns[1])});
  EXPECT_TRUE(torch::allclose(CodeMaps(codes, turns, 10), CodeMaps(turned, same, 10), 1e-4, 1e-4));
}

TEST(CodeMaps, TurnWithARolledCamera) {
  const torch::Tensor codes = RandomCodes(1, 2);
  const std::vector<Eigen::Matrix3d> same{Eigen::Matrix3d::Identity()}, rolled{RotationAboutZ(std::numbers::pi / 2)};
  // x to y, right to down: clockwise in the picture.
  EXPECT_TRUE(torch::allclose(CodeMaps(codes, rolled, 12), CodeMaps(codes, same, 12).rot90(-1, {2, 3}), 1e-4, 1e-4));
}

}  // namespace
}  // namespace antipode
