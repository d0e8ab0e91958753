#include "antipode/matching/light_glue.h"

#include <gtest/gtest.h>

#include "antipode/matching/test_images.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

const LightGlueConfig kSmall{.input_size = 64,
                             .descriptor_size = 96,
                             .layers = 6,
                             .heads = 1,
                             .depth_confidence = -1,
                             .width_confidence = -1,
                             .filter_threshold = 0};
const LightGlueConfig kHeads{.input_size = 48,
                             .descriptor_size = 48,
                             .layers = 4,
                             .heads = 3,
                             .depth_confidence = -1,
                             .width_confidence = -1,
                             .filter_threshold = 0};

LightGlue SyntheticLightGlue(const LightGlueConfig& config) {
  LightGlue network(config);
  FillSynthetic(*network);
  network->Prepare();
  return network;
}

/// 160 x 120 pixels.
LocalFeatures SyntheticFeatures(const std::string& name, int count, int descriptor_size) {
  const auto indices =
      (SyntheticUniform(name + ".keypoints", {count, 2}) + 1) * torch::tensor({80, 60});
  return {(indices + 0.5).to(torch::kFloat),
          SyntheticUniform(name + ".descriptors", {count, descriptor_size}).to(torch::kFloat),
          torch::ones({count}),
          {160, 120}};
}

LightGlueMatches MatchSynthetic(const LightGlue& network, int descriptor_size) {
  return network->Match(SyntheticFeatures("input.a", 60, descriptor_size),
                        SyntheticFeatures("input.b", 50, descriptor_size));
}

void ExpectGolden(const std::string& name, const LightGlueMatches& result) {
  const auto pairs =
      torch::stack({result.matches.reference, result.matches.query}, 1).to(torch::kFloat);
  EXPECT_TRUE(torch::equal(pairs, Golden("light_glue", name + ".matches"))) << name;
  // Exponentials of float32 sums, whose order depends on the processor.
  ExpectNear(result.matches.scores, Golden("light_glue", name + ".scores"), 1e-3);
  EXPECT_EQ(result.layers, Golden("light_glue", name + ".layers").item<float>()) << name;
}

TEST(LightGlue, AgreesWithThePythonPackage) {
  ExpectGolden("plain", MatchSynthetic(SyntheticLightGlue(kSmall), 64));
  ExpectGolden("heads", MatchSynthetic(SyntheticLightGlue(kHeads), 48));
}

TEST(LightGlue, PrunesPointsAsThePythonPackage) {
  LightGlueConfig config = kSmall;
  config.width_confidence = 0.85;
  const LightGlueMatches pruned = MatchSynthetic(SyntheticLightGlue(config), 64);
  ExpectGolden("pruned", pruned);
  EXPECT_LT(pruned.matches.size(), MatchSynthetic(SyntheticLightGlue(kSmall), 64).matches.size());
}

TEST(LightGlue, StopsEarlyAsThePythonPackage) {
  LightGlueConfig config = kHeads;
  config.depth_confidence = 0.9;
  config.width_confidence = 0.5;
  LightGlue network(config);
  FillSynthetic(*network);
  torch::NoGradGuard no_gradient;
  network->named_parameters()["token_confidence.2.token.0.bias"].fill_(4);
  network->Prepare();
  const LightGlueMatches result = MatchSynthetic(network, 48);
  ExpectGolden("early", result);
  EXPECT_EQ(result.layers, 3);
}

TEST(LightGlue, AssignmentsOfTheLastLayerAreThoseOfTheMatches) {
  const LightGlue network = SyntheticLightGlue(kSmall);
  const LocalFeatures a = SyntheticFeatures("input.a", 60, 64), b = SyntheticFeatures("input.b", 50, 64);
  const FeatureMatches matches = network->Match(a, b).matches;
  const std::vector<LightGlueAssignment> assignments = network->Assignments(a, b);
  ASSERT_EQ(assignments.size(), 6U);
  const torch::Tensor probability = assignments.back().log_probability.detach().exp();
  ExpectNear(probability.index({matches.reference, matches.query}), matches.scores, 1e-3);
}

TEST(LightGlue, GradientsReachEveryParameterOfAnAssignment) {
  LightGlue network = SyntheticLightGlue(kSmall);
  torch::Tensor sum = torch::zeros({});
  for (const LightGlueAssignment& assignment : network->Assignments(SyntheticFeatures("input.a", 60, 64), SyntheticFeatures("input.b", 50, 64)))
    sum = sum + assignment.log_probability.mean();
  sum.backward();
  for (const auto& parameter : network->named_parameters()) {
    if (parameter.key().starts_with("token_confidence")) continue;  // says only when to stop
    ASSERT_TRUE(parameter.value().grad().defined()) << parameter.key();
    EXPECT_GT(parameter.value().grad().abs().sum().item<double>(), 0) << parameter.key();
  }
}

TEST(LightGlue, SwappingTheImagesSwapsTheMatches) {
  const LightGlue network = SyntheticLightGlue(kSmall);
  const LocalFeatures a = SyntheticFeatures("input.a", 60, 64),
                      b = SyntheticFeatures("input.b", 50, 64);
  const FeatureMatches forward = network->Match(a, b).matches,
                       backward = network->Match(b, a).matches;
  const auto order = backward.query.argsort();
  EXPECT_TRUE(torch::equal(forward.reference, backward.query.index_select(0, order)));
  EXPECT_TRUE(torch::equal(forward.query, backward.reference.index_select(0, order)));
}

TEST(LightGlue, WithoutFeaturesThereAreNoMatches) {
  const LightGlue network = SyntheticLightGlue(kSmall);
  const LocalFeatures some = SyntheticFeatures("input.a", 60, 64),
                      none = LocalFeatures::None(64, {160, 120});
  EXPECT_EQ(network->Match(some, none).matches.size(), 0);
  EXPECT_EQ(network->Match(none, some).matches.size(), 0);
}

TEST(LightGlue, WhereAllPointsArePrunedThereAreNoMatches) {
  LightGlueConfig config = kSmall;
  config.width_confidence = 1e-9;
  const LightGlueMatches result = MatchSynthetic(SyntheticLightGlue(config), 64);
  EXPECT_EQ(result.matches.size(), 0);
  EXPECT_EQ(result.layers, 1);
}

TEST(LightGlue, RefusesWhatItCannotUse) {
  EXPECT_THROW(LightGlue(LightGlueConfig{.descriptor_size = 10, .heads = 4}), InvalidOption);
  EXPECT_THROW(LightGlue(LightGlueConfig{.layers = 0}), InvalidOption);
  EXPECT_THROW(MatchSynthetic(SyntheticLightGlue(kSmall), 48), Error);
  EXPECT_THROW(MatchSynthetic(LightGlue(kSmall), 64), Error);
}

}  // namespace
}  // namespace antipode
