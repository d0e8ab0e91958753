#include "antipode/evaluation/dilated_masks.h"

#include <algorithm>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "antipode/util/error.h"

namespace antipode {
namespace {

void Dilate(cv::Mat& mask, double share) {
  const int side = static_cast<int>(share * std::min(mask.cols, mask.rows));
  if (side < 1) return;
  cv::Mat dilated;
  cv::dilate(mask, dilated, cv::Mat::ones(side, side, CV_8U));
  mask = dilated;
}

}  // namespace

DilatedMasks::DilatedMasks(std::unique_ptr<Dataset> dataset, double share)
    : AlteredPhotographs(std::move(dataset), [share](ObjectPhotograph& photograph, std::mt19937_64&) { Dilate(photograph.mask, share); }) {
  if (!(share >= 0 && share <= 0.5)) throw InvalidOption("dilate_masks", "must be 0 to 50 percent");
}

}  // namespace antipode
