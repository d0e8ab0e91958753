#pragma once

#include <string>

#include <opencv2/core.hpp>
#include <torch/torch.h>

#include "antipode/synthesis/view_synthesizer.h"

namespace antipode {

/// Whether a model is one that `antipode train volume` wrote.
bool IsViewVolume(const std::string& model);

/// Shows the object of a photograph from other sides by rendering the coarse volume that a network sees in it (ViewVolume): in
/// milliseconds, without chance, and blurred where the picture says nothing.
class VolumeSynthesizer : public ViewSynthesizer {
 public:
  /// @param model by name or folder
  /// @param object_on_white see MakeReferencePicture
  VolumeSynthesizer(const std::string& model, const cv::Mat& object_on_white, torch::Device device = torch::kCPU);

  std::string Fingerprint() const override { return fingerprint_; }

  /// Far enough to show what is deeper than it is wide.
  SynthesisCamera Camera() const override;
  void Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                  const ProgressCallback& progress = {}) const override;

 private:
  torch::Tensor volume_;
  std::string fingerprint_;
};

}  // namespace antipode
