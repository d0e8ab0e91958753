#include "antipode/evaluation/dilated_masks.h"

#include <algorithm>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "antipode/util/error.h"

namespace antipode {

DilatedMasks::DilatedMasks(std::unique_ptr<Dataset> dataset, double share) : dataset_(std::move(dataset)), share_(share) {
  if (!(share >= 0 && share <= 0.5)) throw InvalidOption("dilate_masks", "must be 0 to 50 percent");
}

EvaluationScene DilatedMasks::Load(std::size_t index) const {
  EvaluationScene scene = dataset_->Load(index);
  for (SceneView& view : scene.views) {
    cv::Mat& mask = view.photograph.mask;
    const int side = static_cast<int>(share_ * std::min(mask.cols, mask.rows));
    if (side < 1) continue;
    cv::Mat dilated;
    cv::dilate(mask, dilated, cv::Mat::ones(side, side, CV_8U));
    mask = dilated;
  }
  return scene;
}

}  // namespace antipode
