#include "antipode/nn/efficientnet_lite.h"

#include <gtest/gtest.h>

#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

torch::Tensor TestImage() {
  return ((SyntheticUniform("input.image", {1, 3, 64, 64}) + 1) / 2).to(torch::kFloat);
}

double RelativeDifference(const torch::Tensor& a, const torch::Tensor& reference) {
  return ((a - reference).norm() / reference.norm()).item<double>();
}

TEST(SyntheticWeights, AreTheDocumentedNumbers) {
  const auto demo = SyntheticUniform("input.demo", {4});
  EXPECT_NEAR(demo[0].item<double>(), 0.058057754577056864, 1e-16);
  EXPECT_NEAR(demo[3].item<double>(), 0.2547122720628827, 1e-16);
  const auto weight = SyntheticTensor("backbone.features.0.weight", {64, 3, 3, 3}).flatten();
  EXPECT_FLOAT_EQ(weight[1].item<float>(), 0.22431227564811707f);
}

TEST(EfficientNetLite0, AgreesWithThePythonPackage) {
  const torch::NoGradGuard no_gradient;
  EfficientNetLite0 network;
  FillSynthetic(*network);
  const FeaturePyramid features = network->forward(TestImage());
  const TensorFile expected = SafetensorsReader("tests/data/nn/efficientnet_lite0.safetensors").ReadAll();
  EXPECT_LT(RelativeDifference(features.stride8, ToTorch(expected.tensors.at("stride8"))), 1e-4);
  EXPECT_LT(RelativeDifference(features.stride16, ToTorch(expected.tensors.at("stride16"))), 1e-4);
  EXPECT_LT(RelativeDifference(features.stride32, ToTorch(expected.tensors.at("stride32"))), 1e-4);
}

TEST(EfficientNetLite0, AbsorbingTheNormalizationChangesNothing) {
  const torch::NoGradGuard no_gradient;
  EfficientNetLite0 network;
  FillSynthetic(*network);
  const FeaturePyramid before = network->forward(TestImage());
  network->AbsorbNormalization();
  const FeaturePyramid after = network->forward(TestImage());
  network->AbsorbNormalization();
  const FeaturePyramid twice = network->forward(TestImage());
  EXPECT_LT(RelativeDifference(after.stride32, before.stride32), 1e-4);
  EXPECT_LT(RelativeDifference(twice.stride32, before.stride32), 1e-4);
}

TEST(EfficientNetLite0, FrozenBlocksGetNoGradient) {
  EfficientNetLite0 network;
  FillSynthetic(*network);
  network->FreezeFirstBlocks(3);
  network->forward(TestImage()).stride32.sum().backward();
  for (const auto& item : network->named_parameters()) {
    const bool frozen = item.key().starts_with("_conv_stem") || item.key().starts_with("_bn0") ||
                        item.key().starts_with("_blocks.0.") || item.key().starts_with("_blocks.1.") ||
                        item.key().starts_with("_blocks.2.");
    EXPECT_EQ(item.value().grad().defined(), !frozen) << item.key();
  }
}

TEST(EfficientNetLite0, DropsTheClassifierOfACheckpoint) {
  EfficientNetLite0 network;
  TensorFile checkpoint = WeightsOf(*network);
  const auto plain = checkpoint.tensors.size();
  checkpoint.tensors["_fc.bias"] = HostTensor::FromFloat({2}, std::vector<float>{1, 2});
  EXPECT_EQ(EfficientNetLite0Weights(checkpoint, "a.pth").tensors.size(), plain);
  checkpoint.tensors.erase("_conv_stem.weight");
  checkpoint.tensors["other"] = HostTensor::FromFloat({1}, std::vector<float>{1});
  try {
    EfficientNetLite0Weights(checkpoint, "a.pth");
    FAIL() << "accepted";
  } catch (const BadFile& error) {
    EXPECT_NE(std::string(error.what()).find("_conv_stem.weight"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("other"), std::string::npos);
  }
}

}  // namespace
}  // namespace antipode
