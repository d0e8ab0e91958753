#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "antipode/weights/safetensors.h"

namespace antipode {

/// A model folder: `models/<name>/model.safetensors` beside `card.md` and `model.json`
/// ({"name", "description", "licence", "file", "bytes", "sha256", "tensors", "source"}).
struct ModelEntry {
  std::string name;
  std::string description;
  std::string licence;
  std::filesystem::path file;
  std::uintmax_t bytes = 0;
  std::string sha256;
  std::string source;
  std::size_t tensor_count = 0;
};

/// Shipped models (`ModelsDirectory()`) and imported ones (`UserDataDirectory()/models`), by name.
/// Where both have the same name, the shipped one counts. Folders without a model.json are no
/// models.
/// @throws BadFile naming a model.json that is damaged
std::vector<ModelEntry> ListModels();

/// Whether there is a model of this name; it may still be damaged.
bool IsModelInstalled(const std::string& name);

/// By name, or the model folder at this path.
/// @throws Error listing the known names if there is none called `name`
ModelEntry FindModel(const std::string& name);

/// Size, sha256, tensor count and finiteness of every value. @throws BadFile at the first mismatch
void VerifyModel(const ModelEntry& entry);

/// Verifies, then reads all tensors.
TensorFile LoadModel(const std::string& name);

/// Verifies size, sha256 and tensor count; each tensor is checked for finite values when it is read.
LazyTensorFile OpenModel(const std::string& name);

/// Writes model.safetensors, card.md and model.json into `directory / name`, each atomically,
/// model.json last: an interrupted save leaves no model, or one that fails verification, never a
/// wrong one. The field "source" comes from the metadata `source` of `tensors`.
/// @throws InvalidOption unless `name` consists of letters, digits, '.', '_', '-' and starts with
/// no '.'
/// @throws BadFile naming a tensor with a value that is not finite
ModelEntry SaveModel(const std::filesystem::path& directory, const std::string& name,
                     const TensorFile& tensors, const std::string& description,
                     const std::string& licence, const std::string& card);

/// The same, tensor by tensor.
ModelEntry SaveModel(const std::filesystem::path& directory, const std::string& name,
                     const LazyTensorFile& tensors, const std::string& description,
                     const std::string& licence, const std::string& card);

}  // namespace antipode
