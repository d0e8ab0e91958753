#include "antipode/matching/feature_matches.h"

#include <gtest/gtest.h>

namespace antipode {
namespace {

TEST(MatchMutualNearest, FindsAPermutation) {
  torch::manual_seed(1);
  const auto reference = torch::nn::functional::normalize(torch::randn({40, 16}));
  const auto order = torch::randperm(40);
  const FeatureMatches matches = MatchMutualNearest(reference, reference.index_select(0, order));
  EXPECT_EQ(matches.size(), 40);
  EXPECT_TRUE(torch::equal(order.index_select(0, matches.query), matches.reference));
  EXPECT_TRUE(torch::allclose(matches.scores, torch::ones({40})));
}

TEST(MatchMutualNearest, LeavesOutOneSidedPairs) {
  const auto reference = torch::tensor({{1.0f, 0.0f}, {0.8f, 0.6f}});
  const auto query = torch::tensor({{1.0f, 0.0f}, {-1.0f, 0.0f}});
  const FeatureMatches matches = MatchMutualNearest(reference, query);
  ASSERT_EQ(matches.size(), 1);
  EXPECT_EQ(matches.reference[0].item<int>(), 0);
  EXPECT_EQ(matches.query[0].item<int>(), 0);
  EXPECT_FLOAT_EQ(matches.scores[0].item<float>(), 1);
}

}  // namespace
}  // namespace antipode
