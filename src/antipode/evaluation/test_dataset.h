#pragma once

#include <opencv2/imgproc.hpp>

#include "antipode/evaluation/dataset.h"

namespace antipode {

/// For tests: a grey picture of 100 x 60 pixels with a mask of 20 x 10.
class OnePicture : public Dataset {
 public:
  std::string Name() const override { return "one"; }
  std::size_t ObjectCount() const override { return 1; }
  std::size_t PairCount() const override { return 1; }
  EvaluationScene Load(std::size_t) const override {
    EvaluationScene scene;
    scene.views.resize(1);
    ObjectPhotograph& photograph = scene.views[0].photograph;
    photograph.image = cv::Mat(60, 100, CV_8UC3, cv::Scalar::all(128));
    photograph.mask = cv::Mat::zeros(60, 100, CV_8U);
    cv::rectangle(photograph.mask, cv::Rect(40, 20, 20, 10), cv::Scalar(255), cv::FILLED);
    photograph.image.setTo(cv::Scalar(200, 40, 90), photograph.mask);
    return scene;
  }
};

}  // namespace antipode
