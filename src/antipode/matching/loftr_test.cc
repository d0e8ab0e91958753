#include "antipode/matching/loftr.h"

#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "antipode/matching/loftr_weights.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kSeeds = 10;

torch::Tensor Random(const std::string& name, const std::vector<std::int64_t>& shape) {
  return (SyntheticUniform(name, shape) * std::sqrt(3.0)).to(torch::kFloat);
}

Loftr SyntheticLoftr() {
  Loftr network;
  FillSynthetic(*network);
  return network;
}

torch::Tensor AsImage(const torch::Tensor& pixels) { return pixels.unsqueeze(0).unsqueeze(0); }

double LargestDifference(const torch::Tensor& a, const torch::Tensor& b) {
  return (a - b).abs().max().item<double>();
}

/// Two images, the confidence that gives them matches, and what the published program computes.
struct GoldenPair {
  TensorFile file;
  double min_confidence;

  static GoldenPair Read(const std::string& name, double min_confidence) {
    return {SafetensorsReader("tests/data/matching/" + name + ".safetensors").ReadAll(),
            min_confidence};
  }
  torch::Tensor operator[](const std::string& name) const { return ToTorch(file.tensors.at(name)); }
  LoftrOutput Match(LoftrOptions options = {}) const {
    const torch::NoGradGuard no_gradient;
    options.min_confidence = min_confidence;
    return SyntheticLoftr()->forward(AsImage((*this)["image0"]), AsImage((*this)["image1"]),
                                     options);
  }
};

void ExpectGolden(const LoftrOutput& output, const GoldenPair& golden) {
  ASSERT_TRUE(torch::equal(output.pairs.first, golden["i_ids"]));
  ASSERT_TRUE(torch::equal(output.pairs.second, golden["j_ids"]));
  EXPECT_LT(LargestDifference(output.pairs.confidences, golden["mconf"]), 1e-4);
  EXPECT_LT(LargestDifference(output.offsets, golden["expec_f"].slice(1, 0, 2)), 2e-5);
  EXPECT_LT(LargestDifference(output.deviations, golden["expec_f"].select(1, 2)), 2e-5);
  EXPECT_LT(LargestDifference(output.first_points, golden["mkpts0_f"]), 1e-6);
  EXPECT_LT(LargestDifference(output.second_points, golden["mkpts1_f"]), 2e-4);
}

TEST(Loftr, AgreesWithThePublishedProgram) {
  const GoldenPair golden = GoldenPair::Read("loftr_b", 0.0041);
  ExpectGolden(golden.Match(), golden);
}

TEST(Loftr, AgreesWithThePublishedProgramForImagesOfTwoSizes) {
  const GoldenPair golden = GoldenPair::Read("loftr_c", 0.0063);
  const LoftrOutput output = golden.Match();
  ExpectGolden(output, golden);
  EXPECT_LT(LargestDifference(output.confidence, golden["conf_matrix"][0]), 1e-4);
}

TEST(Loftr, BFloat16ConvolutionsMoveMatchesByLessThanAPixel) {
  const GoldenPair golden = GoldenPair::Read("loftr_b", 0.0041);
  const LoftrOutput output = golden.Match({.bfloat16_convolutions = true});
  const LoftrOutput exact = golden.Match();
  EXPECT_GT(LargestDifference(output.confidence, exact.confidence), 0);
  EXPECT_LT(LargestDifference(output.confidence, exact.confidence), 0.1);
  int found_again = 0;
  for (std::int64_t i = 0; i < exact.pairs.first.size(0); ++i) {
    const auto same = (output.first_points == exact.first_points[i]).all(1) &
                      ((output.second_points - exact.second_points[i]).norm(2, {1}) < 1);
    found_again += same.any().item<bool>();
  }
  EXPECT_GE(found_again, exact.pairs.first.size(0) * 3 / 4);
}

TEST(Loftr, ImagesWithoutMatchesGiveEmptyResults) {
  const torch::NoGradGuard no_gradient;
  const LoftrOutput output =
      SyntheticLoftr()->forward(torch::zeros({1, 1, 8, 16}), torch::zeros({1, 1, 40, 8}));
  EXPECT_EQ(output.confidence.sizes(), (std::vector<std::int64_t>{2, 5}));
  EXPECT_EQ(output.second_points.sizes(), (std::vector<std::int64_t>{0, 2}));
}

TEST(Loftr, RefusesOtherShapes) {
  Loftr network;
  const auto image = torch::zeros({1, 1, 16, 16});
  EXPECT_THROW(network->forward(image, torch::zeros({1, 1, 16, 17})), Error);
  EXPECT_THROW(network->forward(torch::zeros({1, 3, 16, 16}), image), Error);
  EXPECT_THROW(network->forward(torch::zeros({16, 16}), image), Error);
  EXPECT_THROW(network->forward(image, image, {.min_confidence = 1}), InvalidOption);
  EXPECT_THROW(network->forward(image, image, {.border = -1}), InvalidOption);
}

TEST(PositionCode, IsSinesAndCosinesOfColumnsAndRows) {
  const auto code = PositionCode(LoftrPositionCode::kCorrected, 256, 6, 7);
  EXPECT_NEAR(code[0][2][4].item<double>(), std::sin(5), 1e-6);
  const double frequency = std::pow(1e4, -4.0 * 10 / 256);
  EXPECT_NEAR(code[41][2][4].item<double>(), std::cos(5 * frequency), 1e-6);
  EXPECT_NEAR(code[42][2][4].item<double>(), std::sin(3 * frequency), 1e-6);
  const auto floored = PositionCode(LoftrPositionCode::kFloored, 256, 6, 7);
  EXPECT_NEAR(floored[43][2][4].item<double>(), std::cos(3 * std::exp(-20)), 1e-6);
  EXPECT_NEAR(floored[4][2][4].item<double>(), std::sin(5 * std::exp(-2)), 1e-6);
}

/// Attention as it is defined, quadratic in the number of tokens.
torch::Tensor ExplicitAttention(const torch::Tensor& q, const torch::Tensor& k,
                                const torch::Tensor& v) {
  const auto phi = [](const torch::Tensor& x) { return torch::elu(x) + 1; };
  const auto weights = torch::einsum("nlhd,nshd->nlsh", {phi(q), phi(k)});
  const auto sums = weights.sum(2, true) + 1e-6;
  return torch::einsum("nlsh,nshd->nlhd", {weights / sums, v});
}

TEST(LinearAttention, IsTheExplicitAttentionAndIgnoresTheOrderOfTheSource) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    const std::string name = std::to_string(seed);
    const auto q = Random("q" + name, {2, 5, 8, 4});
    const auto k = Random("k" + name, {2, 7, 8, 4}), v = Random("v" + name, {2, 7, 8, 4});
    const auto message = LinearAttention(q, k, v);
    EXPECT_LT(LargestDifference(message, ExplicitAttention(q, k, v)), 1e-5);
    EXPECT_LT(LargestDifference(message, LinearAttention(q, k.flip(1), v.flip(1))), 1e-5);
    EXPECT_GT(LargestDifference(message, LinearAttention(q, k, v.flip(1))), 0.01);
  }
}

TEST(LoftrTransformer, TheSecondImageAttendsToTheUpdatedFirst) {
  const torch::NoGradGuard no_gradient;
  LoftrTransformer transformer(32, 2);
  FillSynthetic(*transformer);
  const auto a = Random("a", {1, 6, 32}), b = Random("b", {1, 9, 32});
  LoftrLayer self(32), cross(32);
  FillSynthetic(*self, "layers.0.");
  FillSynthetic(*cross, "layers.1.");
  const auto self_a = self(a, a), self_b = self(b, b);
  const auto cross_a = cross(self_a, self_b);
  const LoftrTokens tokens = transformer->forward({a, b});
  EXPECT_LT(LargestDifference(tokens.first, cross_a), 1e-5);
  EXPECT_LT(LargestDifference(tokens.second, cross(self_b, cross_a)), 1e-5);
  EXPECT_GT(LargestDifference(tokens.second, cross(self_b, self_a)), 0.01);
}

TEST(DualSoftmax, SwappingTheImagesTransposes) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    const std::string name = std::to_string(seed);
    const auto a = Random("a" + name, {6, 256}), b = Random("b" + name, {9, 256});
    const auto confidence = DualSoftmax(a, b);
    EXPECT_LT(LargestDifference(confidence, DualSoftmax(b, a).t()), 1e-6);
    const auto similarity = torch::matmul(a, b.t()) / 25.6;
    EXPECT_LT(LargestDifference(confidence,
                                torch::softmax(similarity, 0) * torch::softmax(similarity, 1)),
              1e-5);
  }
}

TEST(SelectMutualMaxima, FindsWhatTheDefinitionSays) {
  constexpr CellGrid kFirst{5, 6}, kSecond{7, 5};
  const LoftrOptions options{.min_confidence = 0.3, .border = 1};
  int found = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const auto confidence = SyntheticUniform("confidence" + std::to_string(seed), {30, 35}).abs();
    const CellPairs pairs = SelectMutualMaxima(confidence, kFirst, kSecond, options);
    std::vector<std::int64_t> first, second;
    const auto inside = [](std::int64_t cell, CellGrid grid) {
      const std::int64_t row = cell / grid.columns, column = cell % grid.columns;
      return row >= 1 && row < grid.rows - 1 && column >= 1 && column < grid.columns - 1;
    };
    for (int i = 0; i < 30; ++i) {
      for (int j = 0; j < 35; ++j) {
        const double value = confidence[i][j].item<double>();
        const bool is_maximum = value == confidence[i].max().item<double>() &&
                                value == confidence.select(1, j).max().item<double>();
        if (!is_maximum || value <= 0.3 || !inside(i, kFirst) || !inside(j, kSecond)) continue;
        first.push_back(i);
        second.push_back(j);
      }
    }
    EXPECT_TRUE(torch::equal(pairs.first, torch::tensor(first, torch::kLong)));
    EXPECT_TRUE(torch::equal(pairs.second, torch::tensor(second, torch::kLong)));
    found += static_cast<int>(first.size());
  }
  EXPECT_GT(found, kSeeds);
}

TEST(SelectMutualMaxima, TransposingSwapsThePairs) {
  const LoftrOptions options{.border = 1};
  std::int64_t found = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const auto confidence = SyntheticUniform("confidence" + std::to_string(seed), {64, 49}).abs();
    const CellPairs pairs = SelectMutualMaxima(confidence, {8, 8}, {7, 7}, options);
    const CellPairs swapped = SelectMutualMaxima(confidence.t(), {7, 7}, {8, 8}, options);
    const auto order = swapped.second.argsort();
    EXPECT_TRUE(torch::equal(swapped.second.index({order}), pairs.first));
    EXPECT_TRUE(torch::equal(swapped.first.index({order}), pairs.second));
    found += pairs.first.size(0);
  }
  EXPECT_GT(found, kSeeds);
}

TEST(SelectMutualMaxima, LeavesOutTheBorderAndUncertainPairs) {
  const auto confidence = torch::eye(36) * 0.5;
  const auto cells = [&](const LoftrOptions& options) {
    return SelectMutualMaxima(confidence, {6, 6}, {6, 6}, options).first;
  };
  EXPECT_TRUE(torch::equal(cells({}), torch::tensor({14, 15, 20, 21}, torch::kLong)));
  EXPECT_EQ(cells({.border = 0}).size(0), 36);
  EXPECT_EQ(cells({.min_confidence = 0.5, .border = 0}).size(0), 0);
  EXPECT_EQ(cells({.border = 3}).size(0), 0);
}

TensorFile WithPrefix(const TensorFile& file, const std::string& prefix) {
  TensorFile result;
  for (const auto& [name, tensor] : file.tensors) result.tensors[prefix + name] = tensor;
  return result;
}

std::string Refusal(const TensorFile& checkpoint) {
  try {
    LoftrWeights(checkpoint, "a.ckpt");
  } catch (const BadFile& error) {
    return error.what();
  }
  return "accepted";
}

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(LoftrWeights, ReadsThePublishedNames) {
  const TensorFile plain = WeightsOf(*SyntheticLoftr());
  const std::int64_t elements =
      std::accumulate(plain.tensors.begin(), plain.tensors.end(), std::int64_t{0},
                      [](auto sum, const auto& item) { return sum + item.second.NumElements(); });
  EXPECT_EQ(elements, 11'568'160);
  EXPECT_EQ(plain.tensors.size(), 194u);
  const TensorFile unwrapped = LoftrWeights(WithPrefix(plain, "state_dict.matcher."), "a.ckpt");
  EXPECT_EQ(unwrapped.tensors.size(), plain.tensors.size());
  const std::string name = "backbone.layer2.0.downsample.0.weight";
  EXPECT_EQ(unwrapped.tensors.at(name).data, plain.tensors.at(name).data);
  EXPECT_EQ(LoftrWeights(plain, "a.ckpt").tensors.size(), plain.tensors.size());
}

TEST(LoftrWeights, NamesTheOtherModelAndWhatIsExpected) {
  TensorFile other;
  other.tensors["_conv_stem.weight"] = HostTensor::FromFloat({1}, std::vector<float>{1});
  EXPECT_PRED2(Contains, Refusal(other), "is a checkpoint of EfficientNet-Lite, not of LoFTR");
  EXPECT_PRED2(Contains, Refusal(other), "give indoor_ds_new.ckpt");
  other = WithPrefix(other, "state_dict.model.diffusion_model.");
  EXPECT_PRED2(Contains, Refusal(other), "latent diffusion");
  other.tensors = {{"resnet.conv", HostTensor::FromFloat({1}, std::vector<float>{1})}};
  EXPECT_PRED2(Contains, Refusal(other), "its first tensor is called 'resnet.conv'");
  EXPECT_PRED2(Contains, Refusal({}), "contains no tensors");
}

TEST(LoftrWeights, RefusesDamagedAndRelatedCheckpoints) {
  const TensorFile plain = WeightsOf(*SyntheticLoftr());
  TensorFile damaged = plain;
  damaged.tensors.erase("fine_preprocess.merge_feat.bias");
  damaged.tensors["backbone.bn1.bias"] = HostTensor::FromFloat({1}, std::vector<float>{1});
  EXPECT_PRED2(Contains, Refusal(damaged), "'fine_preprocess.merge_feat.bias' is missing");
  EXPECT_PRED2(Contains, Refusal(damaged), "'backbone.bn1.bias' has shape [1] instead of [128]");
  TensorFile transport = WithPrefix(plain, "state_dict.matcher.");
  transport.tensors["state_dict.matcher.coarse_matching.bin_score"] =
      HostTensor::FromFloat({}, std::vector<float>{1});
  EXPECT_PRED2(Contains, Refusal(transport), "with optimal transport");
}

}  // namespace
}  // namespace antipode
