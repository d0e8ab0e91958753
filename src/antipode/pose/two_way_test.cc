#include "antipode/pose/two_way.h"

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

Rigid3 Turned(double degrees, const Eigen::Vector3d& axis = Eigen::Vector3d::UnitY()) {
  return {Eigen::AngleAxisd(RadiansFromDegrees(degrees), axis).toRotationMatrix(), {0.1, 0.2, 3}};
}

TwoViewPose Estimate(const std::vector<std::pair<Rigid3, double>>& hypotheses, double confidence) {
  TwoViewPose pose;
  for (const auto& [transform, probability] : hypotheses) pose.hypotheses.push_back({transform, probability, "prior"});
  pose.query_from_reference = pose.hypotheses.front().query_from_reference;
  pose.confidence = confidence;
  pose.timings_s["match"] = 1;
  return pose;
}

double AngleDeg(const Rigid3& a, const Rigid3& b) { return AngleBetweenDeg(a.rotation, b.rotation); }

TEST(Reconcile, DirectionsThatAgreeStayAsTheyAre) {
  const auto forward = Estimate({{Turned(50), 0.6}, {Turned(170), 0.2}}, 0.7);
  const auto backward = Estimate({{Turned(50).Inverse(), 0.6}, {Turned(170).Inverse(), 0.2}}, 0.7);
  const TwoViewPose both = Reconcile(forward, Swapped(backward));
  EXPECT_LT(AngleDeg(both.query_from_reference, Turned(50)), 1e-9);
  EXPECT_LT((both.query_from_reference.translation - Turned(50).translation).norm(), 1e-9);
  ASSERT_EQ(both.hypotheses.size(), 2u);
  EXPECT_NEAR(both.hypotheses[0].probability + both.hypotheses[1].probability, 0.8, 1e-9);
  EXPECT_GT(both.hypotheses[0].probability, 0.6) << "agreement speaks for the better one";
  EXPECT_LT(both.evidence.at("two_way_disagreement_deg"), 1e-6);
  EXPECT_EQ(both.timings_s.at("match"), 2);
  EXPECT_TRUE(both.warnings.empty());
}

TEST(Reconcile, WhatBothDirectionsKnowBeatsWhatOneBelieves) {
  const auto forward = Estimate({{Turned(170), 0.45}, {Turned(50), 0.4}}, 0.5);
  const auto backward = Estimate({{Turned(55).Inverse(), 0.6}, {Turned(-100).Inverse(), 0.1}}, 0.6);
  const TwoViewPose both = Reconcile(forward, Swapped(backward));
  EXPECT_LT(AngleDeg(both.query_from_reference, Turned(52)), 5);
  EXPECT_LT(both.confidence, 0.6);
  EXPECT_GT(both.confidence, 0.3);
  ASSERT_EQ(both.warnings.size(), 1u);
  EXPECT_NE(both.warnings[0].find("disagree by 115 degrees"), std::string::npos) << both.warnings[0];
}

TEST(Reconcile, SwappingThePhotographsInverts) {
  const auto forward = Estimate({{Turned(170, {1, 0, 0}), 0.5}, {Turned(50), 0.3}}, 0.5);
  const auto backward = Estimate({{Turned(57).Inverse(), 0.5}, {Turned(-100).Inverse(), 0.2}}, 0.4);
  const Rigid3 one = Reconcile(forward, Swapped(backward)).query_from_reference, other = Reconcile(backward, Swapped(forward)).query_from_reference;
  EXPECT_LT(AngleDeg(one, other.Inverse()), 1e-6);
}

TEST(Reconcile, TheOrderDoesNotCountWhereBothVersionsOfOneModeAreWorthTheSame) {
  const auto forward = Estimate({{Turned(50), 0.6}}, 0.6), backward = Estimate({{Turned(56).Inverse(), 0.6}}, 0.6);
  const Rigid3 one = Reconcile(forward, Swapped(backward)).query_from_reference, other = Reconcile(backward, Swapped(forward)).query_from_reference;
  EXPECT_LT(AngleDeg(one, other.Inverse()), 1e-6);
}

TEST(Reconcile, ADirectionWithoutAnyMassGivesNoConfidence) {
  const TwoViewPose both = Reconcile(Estimate({{Turned(10), 0}}, 0), Estimate({{Turned(90), 0}}, 0));
  EXPECT_EQ(both.confidence, 0);
  EXPECT_EQ(both.hypotheses.front().probability, 0);
}

}  // namespace
}  // namespace antipode
