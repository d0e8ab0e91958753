#include "antipode/matching/network_input.h"

#include <algorithm>

#include <opencv2/imgproc.hpp>

#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kMinSide = 32;

}  // namespace

bool HasNothingToSee(const cv::Mat& image) {
  if (image.type() != CV_8UC3)
    throw Error("matching", "was given an image that is not 8-bit RGB", "convert it to 8UC3");
  if (std::min(image.cols, image.rows) < kMinSide) return true;
  const cv::Vec3b first = image.at<cv::Vec3b>(0, 0);
  return std::all_of(image.begin<cv::Vec3b>(), image.end<cv::Vec3b>(),
                     [&](const cv::Vec3b& pixel) { return pixel == first; });
}

cv::Mat LimitSide(const cv::Mat& image, int max_side) {
  const double scale = static_cast<double>(max_side) / std::max(image.cols, image.rows);
  if (scale >= 1) return image;
  const cv::Size size(std::max(kMinSide, cvRound(image.cols * scale)),
                      std::max(kMinSide, cvRound(image.rows * scale)));
  cv::Mat limited;
  cv::resize(image, limited, size, 0, 0, cv::INTER_AREA);
  return limited;
}

torch::Tensor ToImagePixels(const torch::Tensor& pixels, cv::Size seen, cv::Size image) {
  const auto scale = torch::tensor({static_cast<double>(image.width) / seen.width,
                                    static_cast<double>(image.height) / seen.height},
                                   torch::kDouble)
                         .to(pixels.options());
  return (pixels + 0.5) * scale;
}

}  // namespace antipode
