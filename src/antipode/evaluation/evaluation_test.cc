#include "antipode/evaluation/evaluation.h"

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <utility>

#include <gtest/gtest.h>

#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

/// Views with their poses hidden in the photographs: pixel (0, 0) holds the view's number.
class SyntheticDataset : public Dataset {
 public:
  explicit SyntheticDataset(std::vector<Rigid3> poses) : poses_(std::move(poses)) {}

  std::string Name() const override { return "synthetic"; }
  std::size_t ObjectCount() const override { return 2; }
  std::size_t PairCount() const override { return 2 * (poses_.size() - 1); }

  EvaluationScene Load(std::size_t index) const override {
    EvaluationScene scene;
    scene.object = index == 0 ? "first" : "second";
    scene.symmetric = index == 1;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      ObjectPhotograph photograph;
      photograph.image = cv::Mat(1, 1, CV_8UC3, cv::Scalar::all(static_cast<double>(i)));
      scene.views.push_back({"view " + std::to_string(i), photograph, poses_[i]});
      if (i > 0) scene.pairs.push_back({0, i});
    }
    return scene;
  }

  Rigid3 Truth(const ObjectPhotograph& reference, const ObjectPhotograph& query) const {
    return PoseOf(query) * PoseOf(reference).Inverse();
  }

 private:
  const Rigid3& PoseOf(const ObjectPhotograph& photograph) const {
    return poses_.at(photograph.image.at<cv::Vec3b>(0, 0)[0]);
  }

  std::vector<Rigid3> poses_;
};

SyntheticDataset RandomDataset(int views, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Rigid3> poses;
  for (int i = 0; i < views; ++i) {
    Viewpoint viewpoint = ViewpointFromRotation(RandomRotation(random), 3.5 + 0.1 * i);
    poses.push_back(CameraFromObject(viewpoint));
  }
  return SyntheticDataset(std::move(poses));
}

TwoViewPose PoseWith(const Rigid3& query_from_reference, double confidence = 0.5) {
  TwoViewPose pose;
  pose.query_from_reference = query_from_reference;
  pose.confidence = confidence;
  return pose;
}

PoseMethod Oracle(const SyntheticDataset& dataset) {
  return OnPhotographs("oracle", [&](const ObjectPhotograph& reference, const ObjectPhotograph& query) {
            return PoseWith(dataset.Truth(reference, query));
          });
}

template <typename Check>
void ForEachPair(const EvaluationResult& result, const Check& check) {
  for (const EvaluatedObject& object : result.objects)
    for (const EvaluatedPair& pair : object.pairs) check(pair);
}

TEST(Evaluate, OracleHasNoError) {
  const SyntheticDataset dataset = RandomDataset(12, 1);
  const EvaluationResult result = Evaluate(dataset, Oracle(dataset));
  ASSERT_EQ(result.objects.size(), 2u);
  EXPECT_EQ(result.dataset, "synthetic");
  EXPECT_EQ(result.method, "oracle");
  EXPECT_EQ(result.objects[1].object, "second");
  EXPECT_TRUE(result.objects[1].symmetric);
  ASSERT_EQ(result.objects[0].pairs.size(), 11u);
  EXPECT_EQ(result.objects[0].pairs[4].reference, "view 0");
  EXPECT_EQ(result.objects[0].pairs[4].query, "view 5");
  ForEachPair(result, [](const EvaluatedPair& pair) {
    EXPECT_NEAR(pair.rotation_error_deg, 0, 1e-6);
    EXPECT_NEAR(pair.translation_error_deg.value(), 0, 1e-6);
    EXPECT_FALSE(pair.failed);
    EXPECT_FALSE(pair.swap_difference_deg.has_value());
  });
}

TEST(Evaluate, IdentityErrsByTheTrueRotation) {
  const SyntheticDataset dataset = RandomDataset(12, 2);
  const PoseMethod identity = OnPhotographs("identity", [](const ObjectPhotograph&, const ObjectPhotograph&) {
                              return PoseWith(Rigid3{});
                            });
  ForEachPair(Evaluate(dataset, identity), [](const EvaluatedPair& pair) {
    EXPECT_NEAR(pair.rotation_error_deg, pair.rotation_deg, 1e-9);
    EXPECT_DOUBLE_EQ(pair.translation_error_deg.value(), 180);  // zero has no direction
  });
}

TEST(Evaluate, KnownErrorsAreFound) {
  const SyntheticDataset dataset = RandomDataset(12, 3);
  const PoseMethod off_by_20 = OnPhotographs("off", [&](const auto& reference, const auto& query) {
                               Rigid3 pose = dataset.Truth(reference, query);
                               pose.rotation =
                                   RotationAboutX(RadiansFromDegrees(20)) * pose.rotation;
                               pose.translation *= -3;
                               return PoseWith(pose, 0.7);
                             });
  ForEachPair(Evaluate(dataset, off_by_20), [](const EvaluatedPair& pair) {
    EXPECT_NEAR(pair.rotation_error_deg, 20, 1e-6);
    EXPECT_NEAR(pair.translation_error_deg.value(), 180, 1e-5);
    EXPECT_DOUBLE_EQ(pair.confidence, 0.7);
  });
}

TEST(Evaluate, AngleIsSeenFromTheObjectAndIgnoresRoll) {
  std::vector<Rigid3> poses;
  for (const double azimuth : {0.0, 50.0, 180.0, 300.0})
    poses.push_back(CameraFromObject(
        {.azimuth = azimuth, .in_plane_rotation = 0.4 * azimuth, .distance = 2 + azimuth}));
  const SyntheticDataset dataset(poses);
  const EvaluationResult result = Evaluate(dataset, Oracle(dataset));
  const auto& pairs = result.objects[0].pairs;
  EXPECT_NEAR(pairs[0].angle_deg, 50, 1e-9);
  EXPECT_NEAR(pairs[1].angle_deg, 180, 1e-9);
  EXPECT_NEAR(pairs[2].angle_deg, 60, 1e-9);
  EXPECT_GT(pairs[0].rotation_deg, 51);
}

TEST(Evaluate, ExceptionsAreFailures) {
  const SyntheticDataset dataset = RandomDataset(5, 4);
  int calls = 0;
  const PoseMethod fails_at_first = OnPhotographs("flaky", [&](const auto& reference, const auto& query) {
                                    if (calls++ == 0)
                                      throw std::runtime_error("no object\nbacktrace");
                                    return PoseWith(dataset.Truth(reference, query));
                                  });
  const EvaluationResult result = Evaluate(dataset, fails_at_first);
  const EvaluatedPair& failed = result.objects[0].pairs[0];
  EXPECT_TRUE(failed.failed);
  EXPECT_EQ(failed.failure, "no object");
  EXPECT_EQ(failed.rotation_error_deg, 180);
  EXPECT_EQ(failed.translation_error_deg, 180);
  EXPECT_EQ(failed.confidence, 0);
  EXPECT_FALSE(result.objects[0].pairs[1].failed);
}

TEST(Evaluate, ResultsThatAreNotFiniteCountAsWrong) {
  const SyntheticDataset dataset = RandomDataset(3, 5);
  const PoseMethod broken = OnPhotographs("broken", [](const ObjectPhotograph&, const ObjectPhotograph&) {
                            const double nan = std::numeric_limits<double>::quiet_NaN();
                            Rigid3 pose;
                            pose.rotation(0, 0) = nan;
                            pose.translation.setConstant(nan);
                            return PoseWith(pose, nan);
                          });
  ForEachPair(Evaluate(dataset, broken, {.check_swap = true}), [](const EvaluatedPair& pair) {
    EXPECT_EQ(pair.rotation_error_deg, 180);
    EXPECT_EQ(pair.translation_error_deg, 180);
    EXPECT_EQ(pair.confidence, 0);
    EXPECT_EQ(pair.swap_difference_deg, 180);
  });
}

TEST(Evaluate, TranslationErrorOfPureRotationIsUndefined) {
  const Rigid3 pose;
  const SyntheticDataset dataset({pose, pose});
  const EvaluationResult result = Evaluate(dataset, Oracle(dataset));
  EXPECT_FALSE(result.objects[0].pairs[0].translation_error_deg.has_value());
  const PoseMethod fails = OnPhotographs(
      "fails", [](const ObjectPhotograph&, const ObjectPhotograph&) -> TwoViewPose {
        throw std::runtime_error("no");
      });
  EXPECT_FALSE(Evaluate(dataset, fails).objects[0].pairs[0].translation_error_deg.has_value());
}

TEST(Evaluate, InterruptionIsPassedOn) {
  const SyntheticDataset dataset = RandomDataset(3, 6);
  const PoseMethod interrupted = OnPhotographs(
      "interrupted", [](const ObjectPhotograph&, const ObjectPhotograph&) -> TwoViewPose {
        throw Interrupted("work", "was interrupted");
      });
  EXPECT_THROW(Evaluate(dataset, interrupted), Interrupted);
  const auto stop = [](const Progress& progress) {
    if (progress.done == 2) throw Interrupted("work", "was interrupted");
  };
  EXPECT_THROW(Evaluate(dataset, Oracle(dataset), {}, stop), Interrupted);
}

TEST(Evaluate, ProgressCountsPairs) {
  const SyntheticDataset dataset = RandomDataset(4, 7);
  std::int64_t last = -1;
  Evaluate(dataset, Oracle(dataset), {}, [&](const Progress& progress) {
    EXPECT_EQ(progress.total, 6);
    EXPECT_GE(progress.done, last);
    last = progress.done;
  });
  EXPECT_EQ(last, 6);
}

TEST(Evaluate, LikelyHypothesesAreCounted) {
  const SyntheticDataset dataset = RandomDataset(4, 8);
  const auto turned = [&](const auto& reference, const auto& query, double degrees) {
    Rigid3 pose = dataset.Truth(reference, query);
    pose.rotation = pose.rotation * RotationAboutY(RadiansFromDegrees(degrees));
    return pose;
  };
  const PoseMethod second_is_right = OnPhotographs("two", [&](const auto& reference, const auto& query) {
                                     TwoViewPose pose = PoseWith(turned(reference, query, 170));
                                     pose.hypotheses = {{turned(reference, query, 170), 0.6},
                                                        {turned(reference, query, 29), 0.1},
                                                        {turned(reference, query, 90), 0.09}};
                                     return pose;
                                   });
  ForEachPair(Evaluate(dataset, second_is_right), [](const EvaluatedPair& pair) {
    EXPECT_EQ(pair.likely_hypotheses, 2);
    EXPECT_TRUE(pair.truth_among_likely);
  });
  const PoseMethod unlikely = OnPhotographs("unlikely", [&](const auto& reference, const auto& query) {
                              TwoViewPose pose = PoseWith(turned(reference, query, 0));
                              pose.hypotheses = {{turned(reference, query, 31), 0.6},
                                                 {turned(reference, query, 0), 0.099}};
                              return pose;
                            });
  ForEachPair(Evaluate(dataset, unlikely), [](const EvaluatedPair& pair) {
    EXPECT_EQ(pair.likely_hypotheses, 1);
    EXPECT_FALSE(pair.truth_among_likely);
  });
}

TEST(Evaluate, TheErrorOfMatchingIsThatOfItsBestHypothesis) {
  const SyntheticDataset dataset = RandomDataset(4, 8);
  const PoseMethod method = OnPhotographs("matching", [&](const auto& reference, const auto& query) {
    const auto turned = [&](double degrees) {
      Rigid3 pose = dataset.Truth(reference, query);
      pose.rotation = pose.rotation * RotationAboutY(RadiansFromDegrees(degrees));
      return pose;
    };
    TwoViewPose pose = PoseWith(turned(0));
    pose.hypotheses = {{turned(0), 0.5, "prior"}, {turned(20), 0.3, "matching"}, {turned(90), 0.1, "matching"}};
    return pose;
  });
  ForEachPair(Evaluate(dataset, method), [](const EvaluatedPair& pair) {
    ASSERT_TRUE(pair.matching_error_deg);
    EXPECT_NEAR(*pair.matching_error_deg, 20, 1e-6);
  });
}

TEST(Evaluate, SwapDifferenceIsZeroForConsistentMethodsOnly) {
  const SyntheticDataset dataset = RandomDataset(5, 9);
  ForEachPair(Evaluate(dataset, Oracle(dataset), {.check_swap = true}),
              [](const EvaluatedPair& pair) {
                EXPECT_NEAR(pair.swap_difference_deg.value(), 0, 1e-6);
              });
  const PoseMethod constant = OnPhotographs("constant", [](const ObjectPhotograph&, const ObjectPhotograph&) {
                              Rigid3 pose;
                              pose.rotation = RotationAboutZ(RadiansFromDegrees(10));
                              return PoseWith(pose);
                            });
  ForEachPair(Evaluate(dataset, constant, {.check_swap = true}), [](const EvaluatedPair& pair) {
    EXPECT_NEAR(pair.swap_difference_deg.value(), 20, 1e-6);
  });
}

TEST(Evaluate, StageTimesAreAddedUp) {
  const SyntheticDataset dataset = RandomDataset(4, 10);
  const PoseMethod timed = OnPhotographs("timed", [](const ObjectPhotograph&, const ObjectPhotograph&) {
                           TwoViewPose pose = PoseWith(Rigid3{});
                           pose.timings_s = {{"crop", 0.25}, {"encode", 2}};
                           return pose;
                         });
  const EvaluationResult result = Evaluate(dataset, timed);
  EXPECT_DOUBLE_EQ(result.objects[0].stage_seconds.at("crop"), 0.75);
  EXPECT_DOUBLE_EQ(result.objects[1].stage_seconds.at("encode"), 6);
}

TEST(Evaluation, DrawsSomeOfThePairsWithTheSeed) {
  const SyntheticDataset dataset = RandomDataset(12, 5);
  const auto queries = [&](std::uint64_t seed) {
    std::vector<std::string> names;
    const EvaluationResult result = Evaluate(dataset, Oracle(dataset), {.pairs_per_object = 4, .seed = seed});
    ForEachPair(result, [&](const EvaluatedPair& pair) { names.push_back(pair.query); });
    return names;
  };
  EXPECT_EQ(queries(1).size(), 8u);
  EXPECT_EQ(queries(1), queries(1));
  EXPECT_NE(queries(1), queries(2));
  EXPECT_EQ(Evaluate(dataset, Oracle(dataset), {.pairs_per_object = 99}).objects.front().pairs.size(), 11u);
}

}  // namespace
}  // namespace antipode
