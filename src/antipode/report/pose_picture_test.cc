#include "antipode/report/pose_picture.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/report/confidence_words.h"
#include "antipode/util/formatted.h"

namespace antipode {
namespace {

/// A grey disc in the middle of the picture.
ObjectPhotograph Disc() {
  ObjectPhotograph photograph;
  photograph.camera = PinholeCamera::FromFieldOfView(320, 240, 40);
  photograph.image = cv::Mat(240, 320, CV_8UC3, cv::Scalar(200, 200, 200));
  photograph.mask = cv::Mat(240, 320, CV_8UC1, cv::Scalar(0));
  cv::circle(photograph.mask, {160, 120}, 70, 255, cv::FILLED);
  photograph.image.setTo(cv::Scalar(110, 110, 110), photograph.mask);
  return photograph;
}

TwoViewPose TurnedBy(const ObjectPhotograph& photograph, const Eigen::Matrix3d& rotation) {
  TwoViewPose pose;
  pose.reference = pose.query = MakeObjectView(photograph.image, photograph.mask, photograph.camera);
  pose.query_from_reference = ComposeFromCrops(pose.reference, pose.query, rotation);
  pose.hypotheses = {{pose.query_from_reference, 0.7}};
  pose.confidence = 0.9;
  return pose;
}

/// Centre of the pixels of one colour in a part of the picture, relative to the middle of that part.
cv::Point2d CentreOf(const cv::Mat& picture, const Colour& colour) {
  cv::Mat found;
  cv::inRange(picture, colour, colour, found);
  const cv::Moments moments = cv::moments(found, true);
  EXPECT_GT(moments.m00, 50) << "the colour is hardly there";
  return cv::Point2d(moments.m10 / moments.m00, moments.m01 / moments.m00) -
         0.5 * cv::Point2d(picture.cols, picture.rows);
}

constexpr int kSide = 470, kTop = 68, kReferenceLeft = 24, kQueryLeft = 518;
cv::Mat ReferencePart(const cv::Mat& picture) { return picture(cv::Rect(kReferenceLeft, kTop, kSide, kSide)); }
cv::Mat QueryPart(const cv::Mat& picture) { return picture(cv::Rect(kQueryLeft, kTop, kSide, kSide)); }

TEST(PosePicture, ReferenceShowsRightAndUp) {
  const ObjectPhotograph photograph = Disc();
  const cv::Mat picture =
      DrawPosePicture(TurnedBy(photograph, Eigen::Matrix3d::Identity()), photograph, photograph);
  const cv::Point2d right = CentreOf(ReferencePart(picture), kRed), up = CentreOf(ReferencePart(picture), kGreen);
  EXPECT_GT(right.x, 40);
  EXPECT_NEAR(right.y, 0, 8);
  EXPECT_LT(up.y, -40);
  EXPECT_NEAR(up.x, 0, 8);
}

TEST(PosePicture, IdentityLooksTheSameInBothParts) {
  const ObjectPhotograph photograph = Disc();
  const cv::Mat picture =
      DrawPosePicture(TurnedBy(photograph, Eigen::Matrix3d::Identity()), photograph, photograph);
  for (const Colour& colour : {kRed, kGreen, kBlue})
    EXPECT_LT(cv::norm(CentreOf(ReferencePart(picture), colour) - CentreOf(QueryPart(picture), colour)), 1);
}

TEST(PosePicture, AxesTurnWithTheQuery) {
  const ObjectPhotograph photograph = Disc();
  // A quarter turn about the optical axis, clockwise on the screen: up points right, right points down.
  const cv::Mat picture =
      DrawPosePicture(TurnedBy(photograph, RotationAboutZ(RadiansFromDegrees(90))), photograph, photograph);
  EXPECT_GT(CentreOf(QueryPart(picture), kGreen).x, 40);
  EXPECT_GT(CentreOf(QueryPart(picture), kRed).y, 40);
  EXPECT_LT(CentreOf(ReferencePart(picture), kGreen).y, -40);
}

TEST(PosePicture, FrontPointsTowardsTheReferenceCamera) {
  const ObjectPhotograph photograph = Disc();
  // The query camera stands to the right of the reference camera, so the object's front is on its left.
  const Eigen::Matrix3d query_from_reference = RotationAboutY(RadiansFromDegrees(70));
  const TwoViewPose pose = TurnedBy(photograph, query_from_reference);
  ASSERT_GT(pose.query_from_reference.OriginInSource().x(), 1);
  EXPECT_LT(CentreOf(QueryPart(DrawPosePicture(pose, photograph, photograph)), kBlue).x, -40);
}

TEST(PosePicture, LeavesThePhotographsAlone) {
  const ObjectPhotograph photograph = Disc();
  const cv::Mat before = photograph.image.clone();
  DrawPosePicture(TurnedBy(photograph, Eigen::Matrix3d::Identity()), photograph, photograph);
  EXPECT_EQ(cv::norm(before, photograph.image), 0);
}

TEST(ConfidenceWords, GradesAreOrdered) {
  EXPECT_EQ(ConfidenceWords(0.85), "very likely right");
  EXPECT_EQ(ConfidenceWords(0.849), "probably right");
  EXPECT_EQ(ConfidenceWords(0.35), "uncertain");
  EXPECT_EQ(ConfidenceWords(0), "probably wrong");
  EXPECT_NE(ConfidenceColour(0.9), ConfidenceColour(0.5));
}

TEST(Formatted, LongTextIsWhole) {
  const std::string text(5000, 'x');
  EXPECT_EQ(Formatted("%s %d", text.c_str(), 7), text + " 7");
}

}  // namespace
}  // namespace antipode
