#include "antipode/evaluation/json_file.h"

#include <string>

#include <nlohmann/json.hpp>

#include "antipode/util/error.h"
#include "antipode/util/files.h"

namespace antipode {

nlohmann::json ReadJsonFile(const std::filesystem::path& path) {
  const std::string text = ReadFile(path);
  nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_discarded()) throw BadFile(path.string(), "is not JSON", "check its syntax");
  return json;
}

}  // namespace antipode
