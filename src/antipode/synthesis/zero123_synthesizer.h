#pragma once

#include <functional>
#include <span>
#include <string>

#include <opencv2/core.hpp>

#include "antipode/geometry/camera.h"
#include "antipode/synthesis/view_request.h"
#include "antipode/util/progress.h"
#include "antipode/zero123/zero123.h"

namespace antipode {

struct Zero123SynthesisOptions {
  Zero123Options sampling;
  int batch = 4;  ///< views at a time; memory grows with it
  void Check() const;
};

/// Imagines the object of one photograph.
class Zero123Synthesizer {
 public:
  /// @param model by name or folder
  /// @param image 8UC3, RGB
  /// @param mask 8UC1, > 125 is object
  Zero123Synthesizer(const std::string& model, const cv::Mat& image, const cv::Mat& mask, const PinholeCamera& camera,
                     const Zero123SynthesisOptions& options = {}, torch::Device device = torch::kCPU);

  /// What decides the views: picture, model and sampling. Not the batch.
  const std::string& fingerprint() const { return fingerprint_; }
  /// The picture as the model sees it.
  const cv::Mat& picture() const { return picture_; }

  /// Calls `use` with each view, in the order of the requests, as soon as its batch is done.
  /// @throws Error naming the stage if the model runs out of memory, with what to do
  void Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                  const ProgressCallback& progress = {}) const;

 private:
  std::vector<cv::Mat> Imagine(std::span<const ViewRequest> requests, const ProgressCallback& progress) const;

  Zero123 model_;
  Zero123SynthesisOptions options_;
  cv::Mat picture_;
  std::string fingerprint_;
  PictureConditioning conditioning_;
};

}  // namespace antipode
