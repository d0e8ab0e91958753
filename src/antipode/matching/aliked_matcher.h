#pragma once

#include <string>

#include "antipode/matching/aliked.h"
#include "antipode/matching/light_glue.h"
#include "antipode/matching/matcher.h"

namespace antipode {

/// The model that holds the weights of ALIKED and of its LightGlue.
inline constexpr char kAlikedLightGlueModel[] = "aliked-lightglue";

enum class AlikedVariant {
  kN16,
  kN16Rotated,  ///< trained to tolerate rotation in the image plane
};

/// A model of both variants of ALIKED (float32) and of LightGlue (float16) out of the published
/// checkpoints.
/// @param n16 `aliked-n16.pth`
/// @param n16_rotated `aliked-n16rot.pth`
/// @param light_glue `aliked_lightglue.pth`
/// @throws BadFile listing what is missing or does not belong
TensorFile AlikedLightGlueWeights(const TensorFile& n16, const TensorFile& n16_rotated,
                                  const TensorFile& light_glue, const std::string& source);

/// ALIKED keypoints matched by the LightGlue network that was trained for them; scores are its
/// probabilities.
class AlikedLightGlueMatcher : public Matcher {
 public:
  /// @param light_glue of `LightGlueConfig::ForAliked()`, prepared
  AlikedLightGlueMatcher(Aliked aliked, LightGlue light_glue);

  /// @param model_or_folder a model as `kAlikedLightGlueModel`, imported with `antipode models
  /// import`
  static AlikedLightGlueMatcher Load(const std::string& model_or_folder = kAlikedLightGlueModel,
                                     AlikedVariant variant = AlikedVariant::kN16,
                                     const AlikedOptions& options = {},
                                     torch::Device device = torch::kCPU);

  Correspondences Match(const cv::Mat& reference, const cv::Mat& query) const override;

 private:
  Aliked aliked_;
  LightGlue light_glue_;
};

}  // namespace antipode
