#include "antipode/prior/mode_ranker.h"

#include <random>

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/spherical_harmonics.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/prior/correlation.h"
#include "antipode/prior/object_prior.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kDegree = 4;

class ModeRankerTest : public testing::Test {
 protected:
  ModeRankerTest() {
    FillSynthetic(*ranker_, "ranker.");
    for (int i = 0; i < 5; ++i) modes_.push_back({RandomRotation(random_)});
  }

  torch::Tensor Code() {
    torch::manual_seed(static_cast<std::uint64_t>(random_()));
    return torch::randn({3, SphericalHarmonicCount(kDegree)});
  }

  ModeRanker ranker_{ModeRankerConfig{.max_degree = kDegree, .channels = 3, .points = 32, .width = 8, .hidden = 16}};
  std::mt19937_64 random_{3};
  std::vector<RotationMode> modes_;
};

TEST_F(ModeRankerTest, SwappedImagesGiveInvertedRotationsTheSameWeights) {
  const torch::Tensor reference = Code(), query = Code();
  const auto forth = ranker_->LogWeights(reference, query, modes_);
  for (RotationMode& mode : modes_) mode.rotation = mode.rotation.transpose().eval();
  const auto back = ranker_->LogWeights(query, reference, modes_);
  for (std::size_t k = 0; k < modes_.size(); ++k) EXPECT_NEAR(forth[k], back[k], 1e-5);
  EXPECT_GT(std::abs(forth[0] - forth[1]), 1e-4) << "the rotation must matter";
}

TEST_F(ModeRankerTest, TheLengthOfACodeDoesNotMatter) {
  const torch::Tensor reference = Code(), query = Code();
  const auto one = ranker_->LogWeights(reference, query, modes_), other = ranker_->LogWeights(3 * reference, 0.2 * query, modes_);
  for (std::size_t k = 0; k < modes_.size(); ++k) EXPECT_NEAR(one[k], other[k], 1e-5);
}

TEST_F(ModeRankerTest, TurningObjectAndRotationComparesTheSamePoints) {
  // With the reference turned by D(R) and the rotation by R^T, the query meets the same values; only `place` differs.
  const torch::NoGradGuard no_gradient;
  ranker_->named_parameters()["place.weight"].zero_();
  const torch::Tensor reference = Code(), query = Code();
  const Eigen::Matrix3d turn = RandomRotation(random_);
  const auto answer = [&](const torch::Tensor& code, const Eigen::Matrix3d& rotation) {
    auto rotations = torch::empty({1, 1, 3, 3});
    for (int i = 0; i < 9; ++i) rotations.data_ptr<float>()[i] = static_cast<float>(rotation(i / 3, i % 3));
    return ranker_->forward(code.unsqueeze(0), query.unsqueeze(0), rotations).item<double>();
  };
  const Eigen::Matrix3d rotation = modes_[0].rotation;
  EXPECT_NEAR(answer(reference, rotation), answer(TurnCode(reference, turn), rotation * turn.transpose()), 1e-4);
}

TEST_F(ModeRankerTest, ItsConfigurationIsStored) {
  const ModeRankerConfig stored = ModeRankerConfig::FromMetadata(ranker_->config().ToMetadata(), "model");
  EXPECT_EQ(stored.hidden, 16);
  EXPECT_THROW(ModeRankerConfig::FromMetadata({}, "model"), BadFile);
}

TEST(HarmonicsAt, AreThoseOfEachDirection) {
  const Eigen::Vector3d direction = Eigen::Vector3d(0.3, -0.5, 0.8).normalized();
  const auto directions = torch::tensor({{1.0, 0.0, 0.0}, {direction.x(), direction.y(), direction.z()}}, torch::kDouble);
  const torch::Tensor values = HarmonicsAt(directions, kDegree);
  const Eigen::VectorXd expected = SphericalHarmonics(direction, kDegree);
  ASSERT_EQ(values.size(1), expected.size());
  for (int i = 0; i < expected.size(); ++i) EXPECT_NEAR(values[1][i].item<double>(), expected[i], 1e-6);
}

TEST(Reweigh, KeepsTheSumAndSorts) {
  std::vector<RotationMode> modes(3);
  modes[0].probability = 0.5;
  modes[1].probability = 0.2;
  modes[2].probability = 0.1;
  modes[1].log_weight = 2;
  PriorCalibration calibration;
  calibration.ranker_weight = 1;
  Reweigh(modes, calibration);
  const double scale = 0.8 / (0.5 + 0.2 * std::exp(2.0) + 0.1);
  EXPECT_NEAR(modes[0].probability, scale * 0.2 * std::exp(2.0), 1e-12);
  EXPECT_NEAR(modes[1].probability, scale * 0.5, 1e-12);
  EXPECT_NEAR(modes[2].probability, scale * 0.1, 1e-12);
  EXPECT_NEAR(modes[0].reweighting, scale * std::exp(2.0), 1e-12);
  EXPECT_NEAR(modes[1].reweighting, scale, 1e-12);
}

}  // namespace
}  // namespace antipode
