#include "antipode/zero123/zero123.h"

#include <algorithm>
#include <numeric>
#include <span>

#include <gtest/gtest.h>

#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/check.h"
#include "antipode/weights/registry.h"
#include "antipode/zero123/checkpoint_import.h"
#include "antipode/zero123/test_config.h"

namespace antipode {
namespace {

std::string Fingerprint(std::vector<std::string> lines) {
  std::ranges::sort(lines);
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return Sha256Hex(std::as_bytes(std::span(text)));
}

Zero123 SmallModel() { return SyntheticZero123(TinyZero123()); }

const std::vector<RelativeView> kViews{{10, 30, 0}, {-25, 200, 0}, {0, 90, 0}};
const std::vector<std::string> kNames{"a", "b", "c"};

TEST(Zero123, HasTheTensorsOfThePublishedCheckpoint) {
  std::vector<std::string> lines;
  for (const auto& [name, shape] : Zero123Tensors()) lines.push_back(name + " " + ShapeText(shape));
  EXPECT_EQ(lines.size(), 1232u);
  EXPECT_EQ(Fingerprint(lines), "9e478952e8060f83ca3718a6d83edfddb8637ddf378f9102f29bb7cd0d00a145");
}

TEST(Zero123, KnowsTheNamesOfDiffusersFolders) {
  std::vector<std::string> lines;
  for (const auto& [name, shape] : Zero123Tensors()) {
    const bool is_packed = name.find("in_proj_") != std::string::npos;
    for (const char* const part : is_packed ? std::vector{"q", "k", "v"} : std::vector{""})
      lines.push_back(name + " " + DiffusersName(name, {}, part));
  }
  EXPECT_EQ(lines.size(), 1328u);
  EXPECT_EQ(Fingerprint(lines), "7099f1c8415650b6c912455c1f1970b5ce368c8ec057f155084f3610ca4c9125");
}

TEST(Zero123, AttendingToOneTokenIsAConstant) {
  const torch::InferenceMode inference;
  const Zero123 model = SmallModel();
  const auto tokens = SyntheticUniform("tokens", {2, 1, 32}).to(torch::kFloat), x = SyntheticUniform("x", {2, 8, 8, 8}).to(torch::kFloat);
  const auto time = torch::full({1}, 300.0);
  const auto constant = model.unet->forward(x, time, model.unet->Prepare(tokens));
  const auto general = model.unet->forward(x, time, model.unet->Prepare(tokens, ContextPath::kGeneral));
  EXPECT_LT((constant - general).abs().max().item<double>(), 1e-5);
  EXPECT_GT((constant - model.unet->forward(x, time, model.unet->Prepare(0 * tokens))).abs().max().item<double>(), 1e-3);
}

TEST(Zero123, ComesBackFromDiskInEitherLayoutAndPrecision) {
  const torch::InferenceMode inference;
  const TemporaryFolder folder;
  const Zero123 model = SmallModel();
  const TensorFile weights = AllWeightsOf(model, TinyZero123());
  TensorFile half = weights;
  for (auto& [name, tensor] : half.tensors) tensor = ConvertTo(tensor, Dtype::kF16);
  SaveModel(folder.path(), "rows", weights, "", "", "");
  SaveModel(folder.path(), "channels_last", StoredForUse(LazyViewOf(weights)), "", "", "");
  SaveModel(folder.path(), "half", StoredForUse(LazyViewOf(half)), "", "", "");
  for (const auto& [name, tolerance] : {std::pair{"rows", 0.0}, {"channels_last", 0.0}, {"half", 1e-3}}) {
    const Zero123 loaded = Zero123::Load((folder.path() / name).string());
    const auto expected = model.unet->named_parameters();
    for (const auto& item : loaded.unet->named_parameters())
      ASSERT_LE((item.value() - expected[item.key()]).abs().max().item<double>(), tolerance) << name << " " << item.key();
  }
}

TEST(Zero123, UsesTheWeightsWhereTheyAreMapped) {
  const torch::InferenceMode inference;
  const TemporaryFolder folder;
  const TensorFile weights = AllWeightsOf(SmallModel(), TinyZero123());
  SaveModel(folder.path(), "small", StoredForUse(LazyViewOf(weights)), "", "", "");
  const LazyTensorFile file = OpenSafetensors(folder.path() / "small" / "model.safetensors");
  const LazyTensor convolution = FromChannelsLast(file.tensors.at("unet.out.2.weight"));
  Convolution layer(32, 4);
  LoadInto(*layer, LazyTensorFile{{{"weight", convolution}, {"bias", file.tensors.at("unet.out.2.bias")}}, {}}, "test");
  EXPECT_EQ(layer->weight.data_ptr(), convolution.mapped.bytes.data());
  EXPECT_TRUE(layer->weight.is_contiguous(at::MemoryFormat::ChannelsLast));
}

TEST(Zero123, HalfPrecisionGivesNearlyTheSameViews) {
  const torch::InferenceMode inference;
  const TemporaryFolder folder;
  SaveModel(folder.path(), "small", StoredForUse(LazyViewOf(AllWeightsOf(SmallModel(), TinyZero123()))), "", "", "");
  const std::string path = (folder.path() / "small").string();
  const Zero123 exact = Zero123::Load(path), rounded = Zero123::Load(path, torch::kCPU, DenoiserPrecision::kBFloat16);
  EXPECT_EQ(rounded.unet->parameters().front().scalar_type(), torch::kBFloat16);
  const PictureConditioning picture = exact.Condition(SyntheticUniform("picture", {1, 3, 16, 16}).to(torch::kFloat));
  const Zero123Options options = Zero123Options::Fast();
  const auto expected = exact.SampleLatents(picture, kViews, kNames, options), latents = rounded.SampleLatents(picture, kViews, kNames, options);
  EXPECT_EQ(latents.scalar_type(), torch::kFloat);
  const double error = ((latents - expected).norm() / expected.norm()).item<double>();
  EXPECT_LT(error, 0.03);
  EXPECT_GT(error, 0);
}

TEST(Zero123, RefusesAnUnknownLayout) {
  const TemporaryFolder folder;
  TensorFile weights = AllWeightsOf(SmallModel(), TinyZero123());
  weights.metadata["denoiser_convolutions"] = "spiral";
  SaveModel(folder.path(), "small", weights, "", "", "");
  EXPECT_THROW(Zero123::Load((folder.path() / "small").string()), BadFile);
}

TEST(Zero123, TheLayoutOfTheWeightsChangesNothing) {
  const torch::InferenceMode inference;
  Zero123 model = SmallModel();
  const auto context = model.unet->Prepare(SyntheticUniform("tokens", {1, 1, 32}).to(torch::kFloat));
  const auto x = SyntheticUniform("x", {1, 8, 8, 8}).to(torch::kFloat), time = torch::full({1}, 300.0);
  const auto before = model.unet->forward(x, time, context);
  UseChannelsLast(*model.unet);
  EXPECT_LT((model.unet->forward(x, time, context) - before).abs().max().item<double>(), 1e-5);
}

TEST(Zero123, AShallowStepAfterAFullOneAtTheSamePlaceIsExact) {
  const torch::InferenceMode inference;
  const Zero123 model = SmallModel();
  const auto context = model.unet->Prepare(SyntheticUniform("tokens", {1, 1, 32}).to(torch::kFloat));
  const auto x = SyntheticUniform("x", {1, 8, 8, 8}).to(torch::kFloat), time = torch::full({1}, 300.0);
  for (const std::int64_t blocks : {1, 2}) {
    UnetCache cache{{}, blocks};
    const auto full = model.unet->ForwardAndKeep(x, time, context, cache);
    EXPECT_LT((model.unet->ForwardShallow(x, time, context, cache) - full).abs().max().item<double>(), 1e-6);
  }
  EXPECT_THROW(model.unet->ForwardShallow(x, time, context, {}), Error);
}

TEST(Zero123, AViewDoesNotDependOnTheBatchItIsIn) {
  const torch::InferenceMode inference;
  const Zero123 model = SmallModel();
  const PictureConditioning picture = model.Condition(SyntheticUniform("picture", {1, 3, 16, 16}).to(torch::kFloat));
  for (const Solver solver : {Solver::kDdim, Solver::kDpmSolverPlusPlus, Solver::kUniPc}) {
    const Zero123Options options{.solver = solver, .steps = 4, .eta = solver == Solver::kDdim ? 1.0 : 0.0};
    const auto together = model.SampleLatents(picture, kViews, kNames, options);
    const auto alone = model.SampleLatents(picture, std::span(kViews).subspan(1, 1), std::span(kNames).subspan(1, 1), options);
    EXPECT_LT((together[1] - alone[0]).abs().max().item<double>(), 1e-4) << NameOf(solver);
    EXPECT_GT((together[0] - together[1]).abs().max().item<double>(), 1e-2);
  }
}

TEST(Zero123, TheSeedDecidesTheNoise) {
  EXPECT_TRUE(ViewNoise(1, "a", 0, {4, 2, 2}).equal(ViewNoise(1, "a", 0, {4, 2, 2})));
  EXPECT_FALSE(ViewNoise(1, "a", 0, {4, 2, 2}).equal(ViewNoise(2, "a", 0, {4, 2, 2})));
  EXPECT_FALSE(ViewNoise(1, "a", 0, {4, 2, 2}).equal(ViewNoise(1, "b", 0, {4, 2, 2})));
  EXPECT_FALSE(ViewNoise(1, "a", 0, {4, 2, 2}).equal(ViewNoise(1, "a", 1, {4, 2, 2})));
}

TEST(Zero123, WithoutGuidanceTheUnconditionalHalfIsLeftOut) {
  const torch::InferenceMode inference;
  const Zero123 model = SmallModel();
  const PictureConditioning picture = model.Condition(SyntheticUniform("picture", {1, 3, 16, 16}).to(torch::kFloat));
  const Zero123Options never{.steps = 4, .guidance_begin = 0, .guidance_end = 0}, neutral{.steps = 4, .guidance_scale = 1};
  EXPECT_TRUE(model.SampleLatents(picture, kViews, kNames, never).allclose(model.SampleLatents(picture, kViews, kNames, neutral)));
}

TEST(Zero123, RefusesImpossibleRequests) {
  const Zero123 model = SmallModel();
  const PictureConditioning picture{torch::zeros({1, 1, 32}), torch::zeros({1, 4, 8, 8})};
  EXPECT_THROW(model.SampleLatents(picture, {}, {}), InvalidOption);
  EXPECT_THROW(model.SampleLatents(picture, kViews, kNames, {.steps = 0}), InvalidOption);
  EXPECT_THROW(model.SampleLatents(picture, kViews, kNames, {.steps = 9}), InvalidOption) << "its table ends at 1000";
  EXPECT_THROW(model.SampleLatents(picture, kViews, kNames, {.guidance_begin = 0.5, .guidance_end = 0.2}), InvalidOption);
}

TEST(Zero123, TheConfigurationSurvivesTheMetadata) {
  const Zero123Config config = Zero123Config::FromMetadata(TinyZero123().ToMetadata(), "x");
  EXPECT_EQ(config.ToMetadata(), TinyZero123().ToMetadata());
  EXPECT_EQ(Zero123Config::FromMetadata({}, "x").ToMetadata(), Zero123Config().ToMetadata());
  EXPECT_THROW(Zero123Config::FromMetadata({{"zero123_config", "{"}}, "x"), BadFile);
}

}  // namespace
}  // namespace antipode
