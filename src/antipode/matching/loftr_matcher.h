#pragma once

#include <string>

#include "antipode/matching/loftr.h"
#include "antipode/matching/loftr_weights.h"
#include "antipode/matching/matcher.h"

namespace antipode {

struct LoftrMatcherOptions {
  /// The longer side of what the network sees, pixels: larger images are averaged down to it,
  /// smaller ones enlarged bilinearly, at most twofold. Both sides are rounded to multiples of 8.
  /// Time grows with its square, memory with the fourth power: 160 MB of confidences at 480.
  int max_side = 480;
  LoftrOptions network = {};

  void Check() const;  ///< @throws InvalidOption naming the field
};

/// Correspondences by LoFTR, in grey. None in images without texture, nor where a side of what the
/// network sees has less than 5 cells of 8 pixels.
class LoftrMatcher : public Matcher {
 public:
  /// @param model_or_folder a model imported as `kLoftrModel`
  /// @throws BadFile naming the model file and what is wrong with it
  static LoftrMatcher Load(const std::string& model_or_folder = kLoftrModel,
                           const LoftrMatcherOptions& options = {},
                           torch::Device device = torch::kCPU);

  /// @throws InvalidOption
  explicit LoftrMatcher(Loftr network, const LoftrMatcherOptions& options = {},
                        torch::Device device = torch::kCPU);

  /// @throws Error if an image is not 8UC3
  Correspondences Match(const cv::Mat& reference, const cv::Mat& query) const override;

 private:
  Loftr network_;
  LoftrMatcherOptions options_;
  torch::Device device_;
};

}  // namespace antipode
