#include "antipode/pose/selector_features.h"

#include <map>

#include "antipode/nn/module_weights.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/weights/safetensors.h"
#include "antipode/weights/tensor_hash.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr char kFile[] = "selector_features.safetensors";
constexpr std::size_t kMostBytes = 60'000'000;

std::string LevelName(std::size_t level) { return "level" + std::to_string(level); }

/// What the features belong to, and their own hash.
std::map<std::string, std::string> IdentityOf(const TensorFile& file, const fs::path& folder, const std::string& selector_sha256) {
  return {{"selector_sha256", selector_sha256},
          {"reference_sha256", Sha256OfFile(folder / "reference.json")},
          {"features_sha256", Sha256OfTensors(file)}};
}

}  // namespace

std::optional<SelectorFeatures> ReadSelectorFeatures(const fs::path& folder, const std::string& selector_sha256) {
  if (!fs::exists(folder / kFile)) return std::nullopt;
  try {
    const TensorFile file = SafetensorsReader(folder / kFile).ReadAll();
    if (file.metadata != IdentityOf(file, folder, selector_sha256)) return std::nullopt;
    SelectorFeatures features;
    for (std::size_t level = 0; level < file.tensors.size(); ++level) features.push_back(ToTorch(file.tensors.at(LevelName(level))));
    return features;
  } catch (const Error&) {
    return std::nullopt;
  }
}

void KeepSelectorFeatures(const fs::path& folder, const std::string& selector_sha256, const SelectorFeatures& features) {
  std::size_t bytes = 0;
  TensorFile file;
  for (std::size_t level = 0; level < features.size(); ++level) {
    bytes += features[level].nbytes();
    if (bytes > kMostBytes) return;
    file.tensors[LevelName(level)] = FromTorch(features[level]);
  }
  file.metadata = IdentityOf(file, folder, selector_sha256);
  WriteSafetensors(folder / kFile, file);
}

}  // namespace antipode
