#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "numeric_tensor.h"

namespace antipode::golden {

/// One tensor a case lists.
struct TensorSpec {
  std::string name;
  std::string role;           ///< "input", "expected" or "intermediate"
  nlohmann::json attributes;  ///< everything the manifest says about it, tolerances included
};

/// One case of a manifest. Both manifest formats give the same value: tensors as an object with
/// roles, or as an array of expected tensors.
struct GoldenCase {
  std::string name;
  std::string kind;                 ///< empty if the manifest does not say
  std::filesystem::path file;       ///< the safetensors file with the stored tensors
  nlohmann::json config;            ///< an empty object if there is none
  nlohmann::json generated_inputs;  ///< what has to be generated rather than read
  std::vector<TensorSpec> specs;
  NumericTensors stored;  ///< filled by LoadTensors

  /// @throws Error if the case stores no tensor of this name
  const NumericTensor& Stored(const std::string& tensor) const;
  bool Lists(const std::string& tensor) const;
};

/// Reads `directory`/golden.json. @throws BadFile if it is missing or not a manifest
std::vector<GoldenCase> ReadManifest(const std::filesystem::path& directory);

/// The case with the tensors of its file. @throws BadFile if the file cannot be read
GoldenCase LoadTensors(GoldenCase golden_case);

}  // namespace antipode::golden
