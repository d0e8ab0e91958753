#include "antipode/gen6d/shared_backbone.h"

#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/util/error.h"
#include "antipode/weights/registry.h"
#include "antipode/weights/tensor_hash.h"

namespace antipode {
namespace {

constexpr char kBackbonePrefix[] = "backbone.";

/// The part of a network that holds the backbone, and where it is in names.
std::string PrefixIn(const torch::nn::Module& network) {
  for (const auto& item : network.named_parameters()) {
    const std::size_t at = item.key().find(kBackbonePrefix);
    if (at != std::string::npos) return item.key().substr(0, at + sizeof kBackbonePrefix - 1);
  }
  throw Error("network", "has no backbone");
}

}  // namespace

bool IsBackbone(const std::string& parameter) { return parameter.find(kBackbonePrefix) != std::string::npos; }

TensorFile WithoutBackbone(TensorFile file) {
  std::erase_if(file.tensors, [](const auto& item) { return IsBackbone(item.first); });
  return file;
}

SharedBackbone LoadSharedBackbone(const std::string& model) {
  SharedBackbone backbone{WithoutPrefix(LoadModel(model), kBackbonePrefix), {}};
  if (backbone.tensors.tensors.empty())
    throw BadFile(FindModel(model).file.string(), "has no backbone to share", "name a prior or an imported selector");
  backbone.sha256 = Sha256OfTensors(backbone.tensors);
  return backbone;
}

void LoadBesideBackbone(torch::nn::Module& network, TensorFile rest, const SharedBackbone& backbone, const std::string& source) {
  AddWithPrefix(rest, backbone.tensors, PrefixIn(network));
  LoadInto(network, rest, source);
}

void LoadWithBackbone(torch::nn::Module& network, const TensorFile& file, const std::string& source) {
  const auto shared = file.metadata.find("backbone_model");
  if (shared == file.metadata.end()) return LoadInto(network, file, source);
  const SharedBackbone backbone = LoadSharedBackbone(shared->second);
  if (file.metadata.at("backbone_sha256") != backbone.sha256)
    throw BadFile(source, "was trained with another backbone than that of the model '" + shared->second + "'", "train it again");
  LoadBesideBackbone(network, file, backbone, source);
}

}  // namespace antipode
