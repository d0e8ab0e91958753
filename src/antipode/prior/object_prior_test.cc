#include "antipode/prior/object_prior.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "antipode/geometry/so3_grid.h"
#include "antipode/prior/correlation.h"
#include "antipode/geometry/rotation.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

ObjectEncoderConfig SmallConfig() {
  ObjectEncoderConfig config;
  config.image_size = 64;
  config.max_degree = 4;
  config.channels = 6;
  config.width = 24;
  config.layers = 1;
  config.heads = 2;
  config.feed_forward = 32;
  config.spatial_bases = 4;
  return config;
}

ObjectEncoder SmallEncoder() {
  torch::manual_seed(3);
  return ObjectEncoder(SmallConfig());
}

ObjectView ViewWithDisc(int x, int y) {
  ObjectView view;
  view.image = cv::Mat(64, 64, CV_8UC3, cv::Scalar::all(255));
  cv::circle(view.image, {x, y}, 11, {200, 40, 90}, cv::FILLED);
  cv::rectangle(view.image, {8, 40, 20, 12}, {10, 90, 200}, cv::FILLED);
  return view;
}

TEST(ObjectEncoder, CodesHaveTheLearnedNorm) {
  const torch::NoGradGuard no_gradient;
  auto encoder = SmallEncoder();
  const auto codes = encoder->forward(torch::rand({3, 3, 64, 64}));
  EXPECT_EQ(codes.sizes(), (std::vector<std::int64_t>{3, 6, 25}));
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(codes[i].norm().item<double>(), std::exp(1.0), 1e-3);
}

TEST(ObjectEncoder, ConfigurationSurvivesTheMetadata) {
  const auto metadata = SmallConfig().ToMetadata();
  EXPECT_EQ(ObjectEncoderConfig::FromMetadata(metadata, "x").ToMetadata(), metadata);
  for (const auto& [key, value] : metadata) {
    auto broken = metadata;
    broken.erase(key);
    EXPECT_THROW(ObjectEncoderConfig::FromMetadata(broken, "x"), BadFile) << key;
    broken[key] = "12x";
    EXPECT_THROW(ObjectEncoderConfig::FromMetadata(broken, "x"), Error) << key;
  }
}

TEST(Correlation, IsTheSumOverChannelsAndDegrees) {
  const auto query = torch::randn({2, 3, 9}), reference = torch::randn({2, 3, 9});
  const auto stacked = CorrelateCodes(query, reference, 2);
  ASSERT_EQ(stacked.size(1), WignerSize(2));
  double expected = 0;  // of degree 1, m = 0 (row 1), n = 1 (column 2), second pair
  for (int c = 0; c < 3; ++c) expected += (query[1][c][2] * reference[1][c][3]).item<double>();
  EXPECT_NEAR(stacked[1][WignerOffset(1) + 1 * 3 + 2].item<double>(), expected, 1e-5);
}

TEST(Correlation, KnowingNothingCostsNothing) {
  const auto grid = WignerMatrices(SuperFibonacciRotations(256), 3);
  const auto wigner = torch::from_blob(const_cast<float*>(grid.data()), {256, WignerSize(3)}).clone();
  const auto loss = NegativeLogDensity(torch::zeros({5, WignerSize(3)}), wigner.slice(0, 0, 5), wigner);
  EXPECT_LT(loss.abs().max().item<double>(), 1e-5);
}

TEST(ObjectPrior, BatchingChangesNothing) {
  const ObjectPrior prior(SmallEncoder(), torch::kCPU);
  const ObjectView a = ViewWithDisc(40, 22), b = ViewWithDisc(15, 30);
  const auto together = prior.Encode(std::vector{a, b});
  EXPECT_LT((together[1] - prior.Encode(std::vector{b})[0]).abs().max().item<double>(), 1e-5);
}

TEST(ObjectPrior, ConfidenceIsALogisticFunctionOfTheLogOdds) {
  PriorCalibration calibration;
  calibration.confidence_slope = 0.5;
  calibration.confidence_offset = 1;
  calibration.confidence_score_weight = 0.1;
  const ObjectPrior prior(SmallEncoder(), torch::kCPU, calibration);
  const auto confidence = [&](double probability, double score = 0) {
    return prior.Confidence({Eigen::Matrix3d::Identity(), probability, score});
  };
  EXPECT_NEAR(confidence(0.5), 1 / (1 + std::exp(-1.0)), 1e-12);
  EXPECT_NEAR(confidence(0.5, -10), 0.5, 1e-12);
  EXPECT_LT(confidence(0), confidence(0.3));
  EXPECT_LE(confidence(1), 1);
  const auto metadata = calibration.ToMetadata();
  EXPECT_EQ(PriorCalibration::FromMetadata(metadata, "x").confidence_offset, 1);
  EXPECT_THROW(PriorCalibration::FromMetadata({{"temperature", "-1"}}, "x"), BadFile);
  EXPECT_THROW(PriorCalibration::FromMetadata({{"temperature", "warm"}}, "x"), BadFile);
}

TEST(ObjectPrior, TheSecondStageWeighsModesAndPosteriorAlike) {
  ModeRanker ranker(ModeRankerConfig{.max_degree = 4, .channels = 12, .points = 24, .width = 8, .hidden = 8});
  FillSynthetic(*ranker, "ranker.");
  PriorCalibration calibration;
  calibration.temperature = 0.4;
  calibration.ranker_weight = 30;
  const ObjectPrior one(SmallEncoder(), torch::kCPU, calibration), both(SmallEncoder(), torch::kCPU, calibration, ranker);
  EXPECT_FALSE(one.HasSecondStage());
  EXPECT_TRUE(both.HasSecondStage());
  const auto codes = one.Encode(std::vector{ViewWithDisc(40, 22), ViewWithDisc(15, 30)});
  const auto before = one.Compare(codes[0], codes[1], {.max_modes = 8, .least_probability = 0});
  const auto after = both.Compare(codes[0], codes[1], {.max_modes = 8, .least_probability = 0});
  ASSERT_EQ(before.size(), after.size());
  ASSERT_GT(after.size(), 1u);
  double sum_before = 0, sum_after = 0, change = 0;
  const GridPosterior posterior = both.OnGrid(codes[0], codes[1], both.WeighedModes(codes[0], codes[1]));
  EXPECT_NEAR(posterior.weights.sum(), 1, 1e-9);
  for (std::size_t k = 0; k < after.size(); ++k) {
    sum_before += before[k].probability;
    sum_after += after[k].probability;
    change += std::abs(after[k].probability - before[k].probability);
    EXPECT_NEAR(posterior.MassAround(after[k].rotation), after[k].probability, 0.02);
    EXPECT_LE(after[k].probability, after[k == 0 ? 0 : k - 1].probability);
  }
  EXPECT_NEAR(sum_before, sum_after, 1e-9);
  EXPECT_TRUE(both.CompareWithJoined(codes[0], codes[1]).front().rotation.isApprox(before.front().rotation, 1e-9));
  EXPECT_GT(change, 0.02);
}

TEST(ObjectPrior, RefusesCropsOfAnotherSize) {
  const ObjectPrior prior(SmallEncoder(), torch::kCPU);
  ObjectView view = ViewWithDisc(20, 20);
  cv::resize(view.image, view.image, {32, 32});
  EXPECT_THROW(prior.Encode(std::vector{view}), Error);
}

TEST(ObjectPrior, MirroringBothImagesMirrorsTheScores) {
  torch::manual_seed(5);
  const ObjectPrior prior(SmallEncoder(), torch::kCPU);
  ObjectView a, b;
  a.image = cv::Mat(64, 64, CV_8UC3);
  b.image = cv::Mat(64, 64, CV_8UC3);
  cv::randu(a.image, 0, 255);
  cv::randu(b.image, 0, 255);
  ObjectView a_mirrored, b_mirrored;
  cv::flip(a.image, a_mirrored.image, 1);
  cv::flip(b.image, b_mirrored.image, 1);
  const auto codes = prior.Encode(std::vector{a, b}), mirrored = prior.Encode(std::vector{a_mirrored, b_mirrored});
  const Eigen::DiagonalMatrix<double, 3> mirror(-1, 1, 1);
  std::mt19937_64 random(6);
  for (int i = 0; i < 5; ++i) {
    const Eigen::Matrix3d rotation = RandomRotation(random);
    const double score = prior.posterior().Score(prior.Correlation(codes[0], codes[1]), rotation);
    const double mirrored_score =
        prior.posterior().Score(prior.Correlation(mirrored[0], mirrored[1]), mirror * rotation * mirror);
    EXPECT_NEAR(score, mirrored_score, 1e-4);
  }
}

}  // namespace
}  // namespace antipode
