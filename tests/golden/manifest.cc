#include "manifest.h"

#include <algorithm>
#include <utility>

#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/weights/safetensors.h"

namespace antipode::golden {
namespace {

using nlohmann::json;

std::vector<TensorSpec> SpecsOf(const json& tensors) {
  std::vector<TensorSpec> specs;
  for (const auto& [key, attributes] : tensors.items()) {
    const std::string name = tensors.is_array() ? attributes.at("name").get<std::string>() : key;
    specs.push_back({name, attributes.value("role", "expected"), attributes});
  }
  return specs;
}

GoldenCase CaseOf(const json& entry, const std::filesystem::path& directory) {
  GoldenCase golden_case;
  golden_case.name = entry.contains("case") ? entry.at("case") : entry.at("name");
  golden_case.kind = entry.value("kind", "");
  golden_case.file = directory / entry.at("file").get<std::string>();
  golden_case.config = entry.value("config", json::object());
  golden_case.generated_inputs = entry.contains("inputs")
                                     ? entry.at("inputs")
                                     : entry.value("generated_inputs", json::object());
  golden_case.specs = SpecsOf(entry.at("tensors"));
  return golden_case;
}

}  // namespace

const NumericTensor& GoldenCase::Stored(const std::string& tensor) const {
  const auto found = stored.find(tensor);
  if (found == stored.end()) throw Error(name, "stores no tensor '" + tensor + "'");
  return found->second;
}

bool GoldenCase::Lists(const std::string& tensor) const {
  return std::any_of(specs.begin(), specs.end(),
                     [&](const TensorSpec& spec) { return spec.name == tensor; });
}

std::vector<GoldenCase> ReadManifest(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / "golden.json";
  const std::string text = ReadFile(path);
  try {
    const json manifest = json::parse(text);
    std::vector<GoldenCase> cases;
    for (const json& entry : manifest.at("cases")) cases.push_back(CaseOf(entry, directory));
    return cases;
  } catch (const json::exception& error) {
    throw BadFile(path.string(),
                  std::string("is not a manifest of golden vectors: ") + error.what());
  }
}

GoldenCase LoadTensors(GoldenCase golden_case) {
  for (const auto& [name, tensor] : SafetensorsReader(golden_case.file).ReadAll().tensors) {
    golden_case.stored.emplace(name, NumericTensor(tensor));
  }
  return golden_case;
}

}  // namespace antipode::golden
