#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace antipode {

/// A whole number of a model's metadata. @throws BadFile naming `file` if it is missing or malformed
std::int64_t MetadataNumber(const std::map<std::string, std::string>& metadata, const std::string& name, const std::string& file);

}  // namespace antipode
