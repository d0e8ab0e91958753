#include "antipode/gen6d/shared_backbone.h"

#include <span>

#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/weights/registry.h"

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

TensorFile BackboneOf(const std::string& model) {
  TensorFile backbone = WithoutPrefix(LoadModel(model), kBackbonePrefix);
  if (backbone.tensors.empty()) throw BadFile(FindModel(model).file.string(), "has no backbone to share", "name a prior or an imported selector");
  return backbone;
}

/// Into the parameters and buffers of `network` for which `is_wanted`; all of these must be in the file, nothing else.
template <typename Filter>
void LoadPart(torch::nn::Module& network, const TensorFile& file, const std::string& source, const Filter& is_wanted) {
  const torch::NoGradGuard no_gradient;
  std::size_t used = 0;
  for (auto list : {network.named_parameters(), network.named_buffers()}) {
    for (auto& item : list) {
      if (!is_wanted(item.key()) || !item.value().is_floating_point()) continue;
      const auto found = file.tensors.find(item.key());
      if (found == file.tensors.end()) throw BadFile(source, "lacks the tensor " + item.key());
      const torch::Tensor value = ToTorch(found->second);
      if (value.sizes() != item.value().sizes()) throw BadFile(source, "has another shape of " + item.key());
      item.value().copy_(value);
      ++used;
    }
  }
  if (used != file.tensors.size()) throw BadFile(source, "has tensors that do not belong to the network");
}

}  // namespace

bool IsBackbone(const std::string& parameter) { return parameter.find(kBackbonePrefix) != std::string::npos; }

TensorFile WithoutBackbone(TensorFile file) {
  std::erase_if(file.tensors, [](const auto& item) { return IsBackbone(item.first); });
  return file;
}

void UseSharedBackbone(torch::nn::Module& network, const std::string& model) {
  TensorFile renamed;
  AddWithPrefix(renamed, BackboneOf(model), PrefixIn(network));
  LoadPart(network, renamed, model, IsBackbone);
}

std::string SharedBackboneHash(const std::string& model) {
  std::string text;
  for (const auto& [name, tensor] : BackboneOf(model).tensors) text += name + Sha256Hex(std::span<const std::byte>(tensor.data));
  return Sha256Hex(std::as_bytes(std::span(text)));
}

void LoadBesideBackbone(torch::nn::Module& network, const TensorFile& file, const std::string& source) {
  LoadPart(network, file, source, [](const std::string& name) { return !IsBackbone(name); });
}

void LoadWithBackbone(torch::nn::Module& network, const TensorFile& file, const std::string& source) {
  const auto shared = file.metadata.find("backbone_model");
  if (shared == file.metadata.end()) return LoadInto(network, file, source);
  if (file.metadata.at("backbone_sha256") != SharedBackboneHash(shared->second))
    throw BadFile(source, "was trained with another backbone than that of the model '" + shared->second + "'", "train it again");
  LoadBesideBackbone(network, file, source);
  UseSharedBackbone(network, shared->second);
}

}  // namespace antipode
