#include "antipode/weights/metadata_number.h"

#include <charconv>

#include "antipode/util/error.h"

namespace antipode {

std::int64_t MetadataNumber(const std::map<std::string, std::string>& metadata, const std::string& name, const std::string& file) {
  const auto entry = metadata.find(name);
  if (entry == metadata.end()) throw BadFile(file, "its metadata lacks " + name);
  std::int64_t value = 0;
  const char* const end = entry->second.data() + entry->second.size();
  const auto [stopped, status] = std::from_chars(entry->second.data(), end, value);
  if (status != std::errc() || stopped != end) throw BadFile(file, "its metadata has a malformed " + name);
  return value;
}

}  // namespace antipode
