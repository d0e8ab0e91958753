#include "antipode/evaluation/dilated_masks.h"

#include <gtest/gtest.h>

#include "antipode/evaluation/test_dataset.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

cv::Rect BoxWith(double share) {
  const DilatedMasks dataset(std::make_unique<OnePicture>(), share);
  EXPECT_EQ(dataset.Name(), "one");
  return cv::boundingRect(dataset.Load(0).views[0].photograph.mask);
}

TEST(DilatedMasks, GrowByASquareOfAShareOfTheShorterSide) {
  EXPECT_EQ(BoxWith(0), cv::Rect(40, 20, 20, 10));
  EXPECT_EQ(BoxWith(0.05), cv::Rect(39, 19, 22, 12)) << "a square of 3";
  EXPECT_EQ(BoxWith(0.099), cv::Rect(38, 18, 24, 14)) << "a square of 5.94, truncated";
}

TEST(DilatedMasks, RefuseImpossibleShares) {
  EXPECT_THROW(BoxWith(-0.1), InvalidOption);
  EXPECT_THROW(BoxWith(0.6), InvalidOption);
}

}  // namespace
}  // namespace antipode
