#include "antipode/pose/view_comparison.h"

#include <algorithm>
#include <cmath>

#include "antipode/gen6d/shared_backbone.h"
#include "antipode/geometry/viewpoints.h"
#include "antipode/image/mask.h"
#include "antipode/pose/selector_features.h"
#include "antipode/util/error.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

/// The networks' object frame has +Z up.
Rigid3 FromCanonical(const Rigid3& camera_from_canonical) {
  return {camera_from_canonical.rotation * CanonicalFromObjectRotation(), camera_from_canonical.translation};
}

QueryPicture QueryOf(const ObjectView& crop) { return {crop.image, IntegerIntrinsics(crop.camera)}; }

template <typename Network, typename Config>
std::optional<Network> LoadNetwork(const std::string& name, torch::Device device) {
  if (name.empty()) return std::nullopt;
  const TensorFile file = LoadModel(name);
  Network network(Config::FromMetadata(file.metadata, name));
  LoadWithBackbone(*network, file, name);
  network->to(device);
  network->eval();
  return network;
}

}  // namespace

ViewComparison ViewComparison::Load(const std::string& selector, const std::string& refiner, torch::Device device) {
  ViewComparison comparison(LoadNetwork<Selector, SelectorConfig>(selector, device), LoadNetwork<Refiner, RefinerConfig>(refiner, device));
  if (!selector.empty()) comparison.selector_sha256_ = FindModel(selector).sha256;
  return comparison;
}

std::vector<std::string> ViewComparison::Prepare(const Reference& reference, const std::filesystem::path& folder,
                                                 const ProgressCallback& progress) {
  pictures_.clear();
  for (const SynthesizedView& view : reference.views)
    pictures_.push_back(ToPosedPicture(view.image, view.camera, view.camera_from_object));
  if (!selector_) return {};
  const bool has_store = !folder.empty() && !selector_sha256_.empty();
  const auto kept = has_store ? ReadSelectorFeatures(folder, selector_sha256_) : std::nullopt;
  references_ = PrepareReferences(*selector_, pictures_, {}, kept.value_or(SelectorFeatures()), progress);
  if (kept || !has_store) return {};
  try {
    KeepSelectorFeatures(folder, selector_sha256_, references_.features);
  } catch (const Error& error) {
    return {std::string("the selector's features are computed for every query: ") + error.what()};
  }
  return {};
}

std::vector<ViewComparison::Selection> ViewComparison::Select(const ObjectView& crop, std::size_t count) {
  const QueryPicture query = QueryOf(crop);
  const cv::Mat mask = crop.mask > 125;
  const cv::Rect2d box = MaskBox(mask);
  const QueryCrop query_crop = CentredQueryCrop({box.x, box.y, box.x + box.width - 1, box.y + box.height - 1});
  const std::vector<SelectedPose> selected = SelectViews(*selector_, references_, query, query_crop);
  double sum = 0;
  for (const SelectedPose& pose : selected) sum += std::exp(pose.logit - selected.front().logit);
  std::vector<Selection> selections;
  for (const SelectedPose& pose : selected) {
    if (selections.size() == count) break;
    selections.push_back({FromCanonical(pose.camera_from_object), std::exp(pose.logit - selected.front().logit) / sum});
  }
  return selections;
}

std::vector<std::vector<Rigid3>> ViewComparison::Refine(const ObjectView& crop, const std::vector<Rigid3>& crop_from_object, int iterations) {
  std::vector<Rigid3> starts;
  for (const Rigid3& pose : crop_from_object) starts.push_back(ToCanonicalFrame(pose));
  auto histories = RefinePoses(*refiner_, pictures_, QueryOf(crop), starts, iterations);
  for (auto& history : histories)
    for (Rigid3& pose : history) pose = FromCanonical(pose);
  return histories;
}

}  // namespace antipode
