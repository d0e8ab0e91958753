#include "antipode/evaluation/degraded_pictures.h"

#include <gtest/gtest.h>

#include "antipode/evaluation/test_dataset.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

ObjectPhotograph Degraded(const std::string& name) {
  return DegradedPictures(std::make_unique<OnePicture>(), DegradationNamed(name)).Load(0).views[0].photograph;
}

TEST(DegradedPictures, ChangeThePictureOrTheMask) {
  const ObjectPhotograph plain = OnePicture().Load(0).views[0].photograph;
  for (const std::string name : {"motion-blur", "noise", "jpeg"}) {
    const ObjectPhotograph degraded = Degraded(name);
    EXPECT_GT(cv::norm(degraded.image, plain.image), 0) << name;
    EXPECT_EQ(cv::norm(degraded.mask, plain.mask), 0) << name;
  }
  const ObjectPhotograph cut = Degraded("cut-off");
  EXPECT_EQ(cv::norm(cut.image, plain.image), 0);
  EXPECT_EQ(cv::countNonZero(cut.mask), cv::countNonZero(plain.mask) * 4 / 5);
}

TEST(DegradedPictures, AreTheSameEachTime) {
  for (const std::string name : {"motion-blur", "noise"}) EXPECT_EQ(cv::norm(Degraded(name).image, Degraded(name).image), 0) << name;
}

TEST(DegradedPictures, RefuseWhatTheyDoNotKnow) { EXPECT_THROW(DegradationNamed("fog"), InvalidOption); }

}  // namespace
}  // namespace antipode
