#pragma once

#include <string>

#include "antipode/matching/light_glue.h"
#include "antipode/matching/matcher.h"
#include "antipode/matching/xfeat.h"

namespace antipode {

/// The model that holds the weights of XFeat and of LighterGlue.
inline constexpr char kXFeatLighterGlueModel[] = "xfeat-lighterglue";
/// What comes before the names of their tensors there.
inline constexpr char kXFeatPrefix[] = "xfeat.";
inline constexpr char kLighterGluePrefix[] = "matcher.";
/// The model that holds the weights of a LighterGlue trained on views of objects, to be used with the same XFeat.
inline constexpr char kObjectLighterGlueModel[] = "object-lighterglue";

/// A model of XFeat (float32) and LighterGlue (float16) out of the published checkpoints.
/// @param xfeat `xfeat.pt`
/// @param lighter_glue `xfeat-lighterglue.pt`. It holds XFeat too, but with the batch statistics
/// that its training
///   left behind, other than those that the published features have; they are not used.
/// @throws BadFile listing what is missing or does not belong
TensorFile XFeatLighterGlueWeights(const TensorFile& xfeat, const TensorFile& lighter_glue,
                                   const std::string& source);

enum class XFeatDensity {
  kSparse,     ///< keypoints; scores are cosines of the angle between descriptors
  kSemiDense,  ///< XFeat*: cells, the reference's point refined to the pixel; scores are those of
               ///< the refinement
};

/// Pairs of XFeat features that are each other's most similar.
class XFeatMatcher : public Matcher {
 public:
  explicit XFeatMatcher(XFeat xfeat, XFeatDensity density = XFeatDensity::kSparse);

  /// @param model_or_folder a model as `kXFeatLighterGlueModel`
  static XFeatMatcher Load(const std::string& model_or_folder = kXFeatLighterGlueModel,
                           XFeatDensity density = XFeatDensity::kSparse,
                           const XFeatOptions& options = {}, torch::Device device = torch::kCPU);

  Correspondences Match(const cv::Mat& reference, const cv::Mat& query) const override;

 private:
  Correspondences MatchSparse(const cv::Mat& reference, const cv::Mat& query) const;
  Correspondences MatchSemiDense(const cv::Mat& reference, const cv::Mat& query) const;

  XFeat xfeat_;
  XFeatDensity density_;
};

/// A model as `kXFeatLighterGlueModel`; where it is one as `kObjectLighterGlueModel`, together with the published XFeat.
TensorFile LoadLighterGlueModel(const std::string& lighter_glue);

/// XFeat keypoints matched by LighterGlue, the LightGlue network that was trained for them; scores
/// are its probabilities.
class XFeatLighterGlueMatcher : public Matcher {
 public:
  /// @param lighter_glue of `LightGlueConfig::LighterGlue()`, prepared
  XFeatLighterGlueMatcher(XFeat xfeat, LightGlue lighter_glue);

  /// @param lighter_glue a model as `kXFeatLighterGlueModel` or as `kObjectLighterGlueModel`
  static XFeatLighterGlueMatcher Load(const std::string& lighter_glue = kXFeatLighterGlueModel,
                                      const XFeatOptions& options = {},
                                      torch::Device device = torch::kCPU);

  Correspondences Match(const cv::Mat& reference, const cv::Mat& query) const override;

 private:
  XFeat xfeat_;
  LightGlue lighter_glue_;
};

}  // namespace antipode
