#include "antipode/pose/two_view_pose.h"

#include <gtest/gtest.h>

namespace antipode {
namespace {

TEST(JointConfidence, GrowsWithTheShareAndStaysModest) {
  EXPECT_LT(JointConfidence({.share = 0.3, .support = 50, .prior_confidence = 0.5}),
            JointConfidence({.share = 0.9, .support = 50, .prior_confidence = 0.5}));
  EXPECT_LT(JointConfidence({.share = 1, .support = 500, .prior_confidence = 1}), 0.99);
  EXPECT_GT(JointConfidence({.share = 0, .support = 0, .prior_confidence = 0}), 0);
}

TEST(JointConfidence, AsksThePriorOnlyWhereMatchesAreFew) {
  const auto difference = [](double support) {
    return JointConfidence({.share = 0.9, .support = support, .prior_confidence = 0.9}) -
           JointConfidence({.share = 0.9, .support = support, .prior_confidence = 0.1});
  };
  EXPECT_GT(difference(0), 0.3);
  EXPECT_LT(difference(200), 1e-6);
}

TEST(MatchingProbability, GrowsWithInliersAndFallsWithDisagreement) {
  const MatchingEvidence good{.matches = 400, .inliers = 300, .rotation_deviation_deg = 0.1, .translation_disagreement_deg = 3};
  MatchingEvidence few = good, torn = good;
  few.inliers = 12;
  torn.translation_disagreement_deg = 90;
  EXPECT_GT(MatchingProbability(good), 0.9);
  EXPECT_LT(MatchingProbability(few), MatchingProbability(good));
  EXPECT_LT(MatchingProbability(torn), MatchingProbability(good));
}

}  // namespace
}  // namespace antipode
