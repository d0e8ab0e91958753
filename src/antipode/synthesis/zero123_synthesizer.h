#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include <opencv2/core.hpp>

#include "antipode/synthesis/view_synthesizer.h"
#include "antipode/util/progress.h"
#include "antipode/zero123/zero123.h"

namespace antipode {

struct Zero123SynthesisOptions {
  Zero123Options sampling;
  int batch = 4;  ///< views at a time; memory grows with it
  void Check() const;
};

/// Hash of all that decides imagined views but the requests.
std::string FingerprintOfSynthesis(const cv::Mat& picture, const std::string& model_sha256, const Zero123Options& options);

/// Imagines the object of one photograph. The model is loaded when the first view is asked for.
class Zero123Synthesizer : public ViewSynthesizer {
 public:
  /// @param model by name or folder
  /// @param object_on_white 8UC3, RGB; see MakeReferencePicture
  Zero123Synthesizer(const std::string& model, const cv::Mat& object_on_white, const Zero123SynthesisOptions& options = {},
                     torch::Device device = torch::kCPU);

  ~Zero123Synthesizer() override;

  /// Of picture, model and sampling, not of the batch.
  std::string Fingerprint() const override { return fingerprint_; }

  /// That of the model's training views. The larger side of the picture's object spans two radii.
  SynthesisCamera Camera() const override { return camera_; }

  /// @throws Error naming the stage if the model runs out of memory, with what to do
  void Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                  const ProgressCallback& progress = {}) const override;

  /// The picture as the model sees it.
  const cv::Mat& picture() const { return picture_; }

 private:
  struct Loaded;
  const Loaded& Load() const;
  std::vector<cv::Mat> Imagine(std::span<const ViewRequest> requests, const ProgressCallback& progress) const;

  std::string model_name_;
  Zero123SynthesisOptions options_;
  torch::Device device_;
  cv::Mat picture_;
  SynthesisCamera camera_;
  std::string fingerprint_;
  mutable std::unique_ptr<Loaded> loaded_;
};

}  // namespace antipode
