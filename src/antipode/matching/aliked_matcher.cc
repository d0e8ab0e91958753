#include "antipode/matching/aliked_matcher.h"

#include <utility>

#include "antipode/matching/correspondence_list.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

constexpr char kLightGluePrefix[] = "matcher.";

std::string PrefixOf(AlikedVariant variant) {
  return variant == AlikedVariant::kN16 ? "aliked-n16." : "aliked-n16rot.";
}

/// As the network has them, so that wrong ones are found.
TensorFile Checked(torch::nn::Module& network, const TensorFile& weights,
                   const std::string& source) {
  LoadInto(network, weights, source);
  return WeightsOf(network);
}

}  // namespace

TensorFile AlikedLightGlueWeights(const TensorFile& n16, const TensorFile& n16_rotated,
                                  const TensorFile& light_glue, const std::string& source) {
  TensorFile model;
  LightGlue matcher(LightGlueConfig::ForAliked());
  AddWithPrefix(model, Checked(*matcher, light_glue, source), kLightGluePrefix);
  for (auto& [name, tensor] : model.tensors) tensor = ConvertTo(tensor, Dtype::kF16);
  AlikedNetwork features;
  AddWithPrefix(model, Checked(*features, n16, source), PrefixOf(AlikedVariant::kN16));
  AddWithPrefix(model, Checked(*features, n16_rotated, source),
                PrefixOf(AlikedVariant::kN16Rotated));
  return model;
}

AlikedLightGlueMatcher::AlikedLightGlueMatcher(Aliked aliked, LightGlue light_glue)
    : aliked_(std::move(aliked)), light_glue_(std::move(light_glue)) {}

AlikedLightGlueMatcher AlikedLightGlueMatcher::Load(const std::string& model_or_folder,
                                                    AlikedVariant variant,
                                                    const AlikedOptions& options,
                                                    torch::Device device) {
  const TensorFile file = LoadModel(model_or_folder);
  const LightGlue light_glue = LoadLightGlue(
      LightGlueConfig::ForAliked(), WithoutPrefix(file, kLightGluePrefix), model_or_folder, device);
  return {Aliked(WithoutPrefix(file, PrefixOf(variant)), model_or_folder, options, device),
          light_glue};
}

Correspondences AlikedLightGlueMatcher::Match(const cv::Mat& reference,
                                              const cv::Mat& query) const {
  const torch::InferenceMode inference;
  const LocalFeatures a = aliked_.Detect(reference), b = aliked_.Detect(query);
  const FeatureMatches matches = light_glue_->Match(a, b).matches;
  return ToCorrespondences(a.keypoints.index_select(0, matches.reference),
                           b.keypoints.index_select(0, matches.query), matches.scores);
}

}  // namespace antipode
