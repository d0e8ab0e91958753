#include "antipode/image/degradation.h"

#include <cmath>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "antipode/geometry/rotation.h"

namespace antipode {

cv::Mat MotionBlurred(const cv::Mat& picture, double length, double angle_deg) {
  const int reach = static_cast<int>(std::ceil(length / 2)), size = 2 * reach + 1;
  const double angle = RadiansFromDegrees(angle_deg);
  const cv::Point2d middle(reach, reach), half(length / 2 * std::cos(angle), length / 2 * std::sin(angle));
  constexpr int kFraction = 8;  // binary digits of the line's ends
  const auto fixed = [](const cv::Point2d& point) { return cv::Point(point * (1 << kFraction)); };
  cv::Mat line = cv::Mat::zeros(size, size, CV_8U), kernel, blurred;
  cv::line(line, fixed(middle - half), fixed(middle + half), cv::Scalar(255), 1, cv::LINE_AA, kFraction);
  line.convertTo(kernel, CV_32F, 1 / cv::sum(line)[0]);
  cv::filter2D(picture, blurred, -1, kernel, {-1, -1}, 0, cv::BORDER_REPLICATE);
  return blurred;
}

cv::Mat WithNoise(const cv::Mat& picture, double deviation, std::uint64_t seed) {
  cv::RNG random(seed);
  cv::Mat noise(picture.size(), CV_MAKETYPE(CV_32F, picture.channels())), noisy;
  random.fill(noise, cv::RNG::NORMAL, cv::Scalar::all(0), cv::Scalar::all(deviation));
  cv::add(picture, noise, noisy, cv::noArray(), picture.type());
  return noisy;
}

cv::Mat AfterJpeg(const cv::Mat& picture, int quality) {
  cv::Mat blue_first, decoded;
  cv::cvtColor(picture, blue_first, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", blue_first, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  cv::cvtColor(cv::imdecode(bytes, cv::IMREAD_COLOR), decoded, cv::COLOR_BGR2RGB);
  return decoded;
}

cv::Mat CutOff(const cv::Mat& mask, PictureSide side, double share) {
  const cv::Rect box = cv::boundingRect(mask > 125);
  const bool is_upright = side == PictureSide::kLeft || side == PictureSide::kRight;
  const int strip = static_cast<int>(std::lround(share * (is_upright ? box.width : box.height)));
  const int left = box.x + strip, right = box.br().x - strip, top = box.y + strip, bottom = box.br().y - strip;
  cv::Mat rest = mask.clone();
  switch (side) {
    case PictureSide::kLeft: rest.colRange(0, left).setTo(0); break;
    case PictureSide::kRight: rest.colRange(right, mask.cols).setTo(0); break;
    case PictureSide::kTop: rest.rowRange(0, top).setTo(0); break;
    case PictureSide::kBottom: rest.rowRange(bottom, mask.rows).setTo(0); break;
  }
  return rest;
}

}  // namespace antipode
