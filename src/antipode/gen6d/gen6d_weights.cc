#include "antipode/gen6d/gen6d_weights.h"

#include <algorithm>
#include <string_view>

#include "antipode/gen6d/refiner.h"
#include "antipode/gen6d/selector.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

struct NetworkFamily {
  std::string_view marker, name, command;
};
constexpr NetworkFamily kSelector{"view_point_encoder.", "the selector of Gen6D", "antipode models import gen6d-selector"};
constexpr NetworkFamily kRefiner{"volume_net.", "the refiner of Gen6D", "antipode models import gen6d-refiner"};
constexpr NetworkFamily kDetector{"offset_predict.", "the detector of Gen6D, which the method does without", ""};
constexpr NetworkFamily kLoftr{"loftr_coarse.", "LoFTR", "antipode models import loftr"};
constexpr NetworkFamily kDiffusion{"model.diffusion_model.", "a diffusion model", "antipode models import zero123"};
constexpr NetworkFamily kFamilies[] = {kSelector, kRefiner, kDetector, kLoftr, kDiffusion};

bool Has(const TensorFile& file, std::string_view part) {
  return std::ranges::any_of(file.tensors, [&](const auto& item) { return item.first.find(part) != std::string::npos; });
}

void RequireFamily(const TensorFile& file, const NetworkFamily& wanted, const std::string& source) {
  if (Has(file, wanted.marker)) return;
  const std::string expected = "give model_best.pth of " + std::string(wanted.name);
  for (const NetworkFamily& family : kFamilies) {
    if (!Has(file, family.marker)) continue;
    throw BadFile(source, "is a checkpoint of " + std::string(family.name) + ", not of " + std::string(wanted.name),
                  family.command.empty() ? expected : "import it with: " + std::string(family.command));
  }
  throw BadFile(source, "is no checkpoint of " + std::string(wanted.name), expected);
}

template <typename Network>
TensorFile Converted(const TensorFile& checkpoint, const NetworkFamily& family, const std::string& source) {
  RequireFamily(checkpoint, family, source);
  const TensorFile inner = WithoutPrefix(checkpoint, "network_state_dict.");
  Network network;
  LoadInto(*network, inner.tensors.empty() ? checkpoint : inner, source);
  TensorFile file = WeightsOf(*network);
  file.metadata = network->config().ToMetadata();
  return file;
}

}  // namespace

TensorFile Gen6dSelectorWeights(const TensorFile& checkpoint, const std::string& source) {
  return Converted<Selector>(checkpoint, kSelector, source);
}

TensorFile Gen6dRefinerWeights(const TensorFile& checkpoint, const std::string& source) {
  return Converted<Refiner>(checkpoint, kRefiner, source);
}

}  // namespace antipode
