#include "antipode/training/learning_rate.h"

#include <limits>

#include <gtest/gtest.h>

#include "antipode/training/loss_average.h"

namespace antipode {
namespace {

TEST(LearningRateFactor, RisesThenFallsAsACosine) {
  EXPECT_DOUBLE_EQ(LearningRateFactor(0, 4, 0, 0.1), 0.25);
  EXPECT_DOUBLE_EQ(LearningRateFactor(3, 4, 0, 0.1), 1);
  EXPECT_DOUBLE_EQ(LearningRateFactor(100, 4, 0.5, 0.1), 0.55);
  EXPECT_DOUBLE_EQ(LearningRateFactor(100, 4, 1, 0.1), 0.1);
  EXPECT_DOUBLE_EQ(LearningRateFactor(100, 4, 1.5, 0.1), 0.1);
  EXPECT_DOUBLE_EQ(LearningRateFactor(0, 0, 0), 1);
}

TEST(SetLearningRate, ChangesOneGroup) {
  const torch::Tensor a = torch::zeros({1}).requires_grad_(), b = torch::zeros({1}).requires_grad_();
  torch::optim::AdamW optimizer({torch::optim::OptimizerParamGroup({a}), torch::optim::OptimizerParamGroup({b})},
                                torch::optim::AdamWOptions(0.5));
  SetLearningRate(optimizer, 0.25, 1);
  const auto rate = [&](std::size_t group) { return optimizer.param_groups()[group].options().get_lr(); };
  EXPECT_EQ(rate(0), 0.5);
  EXPECT_EQ(rate(1), 0.25);
}

TEST(LossAverage, KeepsTheFirstStepsAndFollowsTheLast) {
  LossAverage losses(2);
  losses.Add(4);
  EXPECT_EQ(losses.first(), 4);
  losses.Add(2);
  losses.Add(1);
  EXPECT_EQ(losses.first(), 3);
  EXPECT_EQ(losses.last(), 2);
  EXPECT_THROW(losses.Add(std::numeric_limits<double>::quiet_NaN()), Error);
}

}  // namespace
}  // namespace antipode
