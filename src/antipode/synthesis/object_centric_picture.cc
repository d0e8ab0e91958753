#include "antipode/synthesis/object_centric_picture.h"

#include <algorithm>

#include <opencv2/imgproc.hpp>

#include "antipode/zero123/picture.h"

namespace antipode {

cv::Mat ObjectCentricPicture(const cv::Mat& object_on_white, int size) {
  const cv::Rect box = BoxOfObject(object_on_white);
  const cv::Mat object = object_on_white(cv::Rect(box.tl(), box.size() + cv::Size(1, 1)));
  const int side = static_cast<int>((1 + 2 * kObjectCentricMargin) * std::max(object.cols, object.rows));
  cv::Mat picture;
  cv::resize(PaddedToSquare(object, side), picture, {size, size}, 0, 0, cv::INTER_AREA);
  return picture;
}

}  // namespace antipode
