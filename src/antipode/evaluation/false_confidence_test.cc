#include "antipode/evaluation/false_confidence.h"

#include <set>

#include <gtest/gtest.h>

#include "antipode/util/error.h"

namespace antipode {
namespace {

class NamedObjects : public Dataset {
 public:
  explicit NamedObjects(std::size_t objects) : objects_(objects) {}

  std::string Name() const override { return "named"; }
  std::size_t ObjectCount() const override { return objects_; }
  std::size_t PairCount() const override { return 0; }
  EvaluationScene Load(std::size_t index) const override {
    EvaluationScene scene;
    scene.object = std::to_string(index);
    for (const char* view : {"a", "b", "c"}) scene.views.push_back({scene.object + view, {}, {}});
    return scene;
  }

 private:
  std::size_t objects_;
};

TEST(FalseConfidence, ComparesViewsOfDifferentObjectsOnly) {
  int calls = 0;
  std::set<std::string> references;
  const PoseMethod method{"recorder", [&](const PairToEstimate& pair) {
                            ++calls;
                            EXPECT_NE(pair.reference.name.front(), pair.query.name.front());
                            references.insert(pair.reference.name);
                            return TwoViewPose{};
                          }};
  const FalseConfidence result = MeasureFalseConfidence(NamedObjects(4), method, {.pairs = 50});
  EXPECT_EQ(calls, 50);
  EXPECT_EQ(result.confidences.size(), 50u);
  EXPECT_GE(references.size(), 10u) << "of 12 views";
}

TEST(FalseConfidence, CountsConfidencesAboveTheLimitAndFailuresAsZero) {
  int call = 0;
  const PoseMethod method{"varied", [&](const PairToEstimate&) -> TwoViewPose {
                            if (++call % 4 == 0) throw Error("matching", "found nothing");
                            TwoViewPose pose;
                            pose.confidence = call % 4 == 1 ? 0.9 : 0.5;
                            return pose;
                          }};
  const FalseConfidence result = MeasureFalseConfidence(NamedObjects(2), method, {.pairs = 40});
  EXPECT_EQ(result.failures, 10);
  EXPECT_DOUBLE_EQ(result.ShareAbove(0.5), 25);
  EXPECT_DOUBLE_EQ(result.ShareAbove(0.95), 0);
}

TEST(FalseConfidence, NeedsTwoObjects) {
  const PoseMethod method{"none", [](const PairToEstimate&) { return TwoViewPose{}; }};
  EXPECT_THROW(MeasureFalseConfidence(NamedObjects(1), method), InvalidOption);
}

}  // namespace
}  // namespace antipode
