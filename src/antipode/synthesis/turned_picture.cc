#include "antipode/synthesis/turned_picture.h"

#include <algorithm>

#include "antipode/geometry/rotation.h"
#include "antipode/zero123/picture.h"

namespace antipode {

std::vector<TurnedPicture> TurnPictures(const cv::Mat& picture, std::span<const double> angles_deg) {
  std::vector<TurnedPicture> pictures;
  int side = 0;
  for (const double angle : angles_deg) {
    const cv::Mat turned = TurnedOnWhite(picture, angle);
    pictures.push_back({turned(BoxOfObject(turned)).clone(), {}});
    side = std::max({side, pictures.back().object.cols, pictures.back().object.rows});
  }
  for (TurnedPicture& turned : pictures) turned.padded = PaddedToSquare(turned.object, side);
  return pictures;
}

Rigid3 TurnedPose(const Rigid3& camera_from_object, double angle_deg) {
  return Rigid3{RotationAboutZ(-RadiansFromDegrees(angle_deg)), Eigen::Vector3d::Zero()} * camera_from_object;
}

}  // namespace antipode
