#include "antipode/orientation/in_plane.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "antipode/geometry/object_centric_published.h"
#include "antipode/geometry/rotation.h"

namespace antipode {
namespace {

const cv::Scalar kWhite = cv::Scalar::all(255);

cv::Mat PaddedTo(const cv::Mat& picture, int side) {
  const int top = (side - picture.rows) / 2, left = (side - picture.cols) / 2;
  cv::Mat padded;
  cv::copyMakeBorder(picture, padded, top, side - picture.rows - top, left, side - picture.cols - left, cv::BORDER_CONSTANT, kWhite);
  return padded;
}

cv::Mat Turned(const cv::Mat& square, double angle_deg) {
  const float middle = 0.5f * static_cast<float>(square.cols - 1);
  cv::Mat turned;
  cv::warpAffine(square, turned, cv::getRotationMatrix2D({middle, middle}, angle_deg, 1), square.size(), cv::INTER_CUBIC,
                 cv::BORDER_CONSTANT, kWhite);
  return turned;
}

cv::Mat CutToObject(const cv::Mat& picture) {
  const auto box = published::NonWhiteBox(std::span(picture.data, picture.total() * 3), picture.cols, picture.rows);
  const cv::Point corner(static_cast<int>(box.x0), static_cast<int>(box.y0));
  const int width = std::max(1, static_cast<int>(box.x1 - box.x0)), height = std::max(1, static_cast<int>(box.y1 - box.y0));
  return picture(cv::Rect(corner, cv::Size(width, height))).clone();
}

}  // namespace

std::vector<TurnedPicture> TurnPictures(const cv::Mat& picture, std::span<const double> angles_deg) {
  const cv::Mat square = PaddedTo(picture, static_cast<int>(std::hypot(picture.cols, picture.rows)));
  std::vector<TurnedPicture> pictures;
  int side = 0;
  for (const double angle : angles_deg) {
    pictures.push_back({CutToObject(Turned(square, angle)), {}});
    side = std::max({side, pictures.back().object.cols, pictures.back().object.rows});
  }
  for (TurnedPicture& turned : pictures) turned.padded = PaddedTo(turned.object, side);
  return pictures;
}

Rigid3 TurnedPose(const Rigid3& camera_from_object, double angle_deg) {
  return Rigid3{RotationAboutZ(-RadiansFromDegrees(angle_deg)), Eigen::Vector3d::Zero()} * camera_from_object;
}

}  // namespace antipode
