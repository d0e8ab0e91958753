#include "antipode/synthesis/reference_picture.h"

#include <algorithm>

#include <opencv2/imgproc.hpp>

#include "antipode/geometry/look_at.h"
#include "antipode/object/object_view.h"
#include "antipode/synthesis/turned_picture.h"

namespace antipode {
namespace {

constexpr int kLeastCrop = 32, kGreatestCrop = 2048;

int LargerSide(const cv::Mat& picture) { return std::max(picture.cols, picture.rows); }

}  // namespace

Rigid3 ReferencePicture::CameraFromObject(double elevation_deg) const {
  const Viewpoint viewpoint{.elevation = elevation_deg, .in_plane_rotation = in_plane_rotation_deg, .distance = distance};
  return Rigid3{crop_from_camera.transpose(), Eigen::Vector3d::Zero()} * antipode::CameraFromObject(viewpoint);
}

ReferencePicture MakeReferencePicture(const cv::Mat& image, const cv::Mat& mask, const PinholeCamera& camera,
                                      double in_plane_rotation_deg) {
  const cv::Rect box = cv::boundingRect(mask > 125);
  ObjectViewOptions options;
  options.size = std::clamp(static_cast<int>((1 + 2 * options.margin) * std::max(box.width, box.height)), kLeastCrop, kGreatestCrop);
  const ObjectView view = MakeObjectView(image, mask, camera, options);
  ReferencePicture result{view.image, view.crop_from_camera, in_plane_rotation_deg, view.distance};
  if (in_plane_rotation_deg == 0) return result;
  const double turns[] = {0, in_plane_rotation_deg};
  const auto turned = TurnPictures(view.image, turns);
  result.distance *= static_cast<double>(LargerSide(turned[0].object)) / LargerSide(turned[1].object);
  result.picture = turned[1].padded;
  return result;
}

}  // namespace antipode
