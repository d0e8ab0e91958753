#pragma once

#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "antipode/synthesis/view_guide.h"
#include "antipode/synthesis/zero123_synthesizer.h"
#include "antipode/weights/safetensors.h"
#include "antipode/zero123/view_diffusion.h"

namespace antipode {

/// Whether a model is one that `antipode train views` wrote.
bool IsViewDiffusion(const std::string& model);

/// Imagines the object of a photograph with a small diffusion model, object-centric and at its small size.
class SmallSynthesizer : public ViewSynthesizer {
 public:
  /// @param model by name or folder
  /// @param object_on_white see MakeReferencePicture
  SmallSynthesizer(const std::string& model, const cv::Mat& object_on_white, const Zero123SynthesisOptions& options = {},
                   torch::Device device = torch::kCPU);

  std::string Fingerprint() const override { return fingerprint_; }
  SynthesisCamera Camera() const override;
  void Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                  const ProgressCallback& progress = {}) const override;

 private:
  SmallSynthesizer(const TensorFile& file, const std::string& model, const cv::Mat& object_on_white, const Zero123SynthesisOptions& options,
                   torch::Device device);

  mutable ViewDiffusion model_;
  std::optional<ViewGuide> guide_;
  Zero123SynthesisOptions options_;
  torch::Tensor picture_;  // [1, 3, S, S], -1..1
  torch::Tensor code_;     // of the guide
  std::string fingerprint_;
};

/// The synthesiser that fits the model: Zero123, a small diffusion model, or a volume.
std::unique_ptr<ViewSynthesizer> MakeDiffusionSynthesizer(const std::string& model, const cv::Mat& object_on_white,
                                                          const Zero123SynthesisOptions& options, torch::Device device);

}  // namespace antipode
