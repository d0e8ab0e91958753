#include "antipode/matching/loftr_weights.h"

#include <algorithm>
#include <string_view>

#include "antipode/matching/loftr.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/util/error.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

constexpr char kOwnMarker[] = "loftr_coarse.";
constexpr char kOptimalTransportMarker[] = "bin_score";
constexpr char kRemedy[] =
    "give indoor_ds_new.ckpt of LoFTR, whose tensors are named state_dict.matcher.backbone..., "
    "state_dict.matcher.loftr_coarse... and so on";

/// A network that people may have at hand, and what only its tensors' names contain.
struct ModelFamily {
  std::string_view marker, name;
};
constexpr ModelFamily kOtherFamilies[] = {
    {"model.diffusion_model.", "a latent diffusion model such as Zero123"},
    {"view_point_encoder.", "the selector of Gen6D"},
    {"volume_net.", "the refiner of Gen6D"},
    {"offset_predict.", "the detector of Gen6D"},
    {"_conv_stem.", "EfficientNet-Lite"},
    {"token_confidence.", "LightGlue"},
    {"keypoint_head.", "XFeat"},
    {"convPa.", "SuperPoint"},
    {"kenc.encoder.", "SuperGlue"},
};

bool HasNameWith(const TensorFile& file, std::string_view part) {
  return std::ranges::any_of(
      file.tensors, [&](const auto& item) { return item.first.find(part) != std::string::npos; });
}

std::string OtherFamilyOf(const TensorFile& file) {
  for (const ModelFamily& family : kOtherFamilies)
    if (HasNameWith(file, family.marker))
      return "is a checkpoint of " + std::string(family.name) + ", not of LoFTR";
  if (file.tensors.empty()) return "contains no tensors";
  return "is no checkpoint of LoFTR: its first tensor is called " +
         Quoted(file.tensors.begin()->first);
}

/// The tensors whose names begin with `prefix`, without it; all of them if none does.
TensorFile Unwrapped(const TensorFile& file, const std::string& prefix) {
  TensorFile inner = WithoutPrefix(file, prefix);
  return inner.tensors.empty() ? file : inner;
}

}  // namespace

TensorFile LoftrWeights(const TensorFile& checkpoint, const std::string& source) {
  if (!HasNameWith(checkpoint, kOwnMarker))
    throw BadFile(source, OtherFamilyOf(checkpoint), kRemedy);
  if (HasNameWith(checkpoint, kOptimalTransportMarker))
    throw BadFile(source,
                  "is a checkpoint of LoFTR with optimal transport, not with the dual softmax",
                  kRemedy);
  Loftr network;
  LoadInto(*network, Unwrapped(Unwrapped(checkpoint, "state_dict."), "matcher."), source);
  return WeightsOf(*network);
}

}  // namespace antipode
