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
  DenoiserPrecision precision = DenoiserPrecision::kFloat32;
  double memory_limit_gb = 0;  ///< so much memory in all, 10^9 bytes: the batch is made smaller; 0: no limit
  void Check() const;
};

/// What the program needs to imagine so many views of 256 pixels at a time, bytes: the weights, the activations of the denoiser,
/// and what one picture's decoding takes. Not below what was measured for 1 to 16 views, and at most 0.2 GB above.
double MemoryForViews(const Zero123& model, int views);

/// Hash of all that decides imagined views but the requests.
std::string FingerprintOfSynthesis(const cv::Mat& picture, const std::string& model_sha256, const Zero123SynthesisOptions& options);

/// Imagines the object of one photograph. The model is loaded when the first view is asked for.
class Zero123Synthesizer : public ViewSynthesizer {
 public:
  /// @param model by name or folder
  /// @param object_on_white 8UC3, RGB; see MakeReferencePicture
  Zero123Synthesizer(const std::string& model, const cv::Mat& object_on_white, const Zero123SynthesisOptions& options = {},
                     torch::Device device = torch::kCPU);

  ~Zero123Synthesizer() override;

  /// Of picture, model, sampling and precision, not of the batch.
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
  /// The batch that the options and the memory allow. @throws Error if not even one view fits
  std::size_t BatchFor(const Zero123& model) const;
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
