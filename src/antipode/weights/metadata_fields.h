#pragma once

#include <map>
#include <string>

#include "antipode/util/error.h"
#include "antipode/weights/metadata_number.h"

namespace antipode {

/// A whole number of a configuration that is stored in a model's metadata.
template <typename Config>
struct MetadataField {
  const char* name;
  int Config::* value;
  int least, most;
};

/// @param prefix of the names in messages
/// @throws Error naming the first field outside its range
template <typename Config, std::size_t kCount>
void CheckFields(const MetadataField<Config> (&fields)[kCount], const Config& config, const std::string& prefix = "") {
  for (const auto& field : fields) {
    const int value = config.*field.value;
    if (value < field.least || value > field.most)
      throw InvalidOption(prefix + field.name, "is " + std::to_string(value),
                          "use " + std::to_string(field.least) + " to " + std::to_string(field.most));
  }
}

template <typename Config, std::size_t kCount>
void WriteFields(const MetadataField<Config> (&fields)[kCount], const Config& config, std::map<std::string, std::string>& metadata) {
  for (const auto& field : fields) metadata[field.name] = std::to_string(config.*field.value);
}

/// @throws BadFile naming `file` and the missing or malformed field
template <typename Config, std::size_t kCount>
void ReadFields(const MetadataField<Config> (&fields)[kCount], const std::map<std::string, std::string>& metadata, const std::string& file,
                Config& config) {
  for (const auto& field : fields) config.*field.value = static_cast<int>(MetadataNumber(metadata, field.name, file));
}

}  // namespace antipode
