#include "antipode/cli/processor.h"

#include <fstream>
#include <set>
#include <sstream>
#include <utility>

namespace antipode {
namespace {

/// The value behind "key : " in /proc/cpuinfo, of the first processor.
std::string ProcessorField(const std::string& key) {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(':');
    if (line.starts_with(key) && colon != std::string::npos && colon + 2 <= line.size())
      return line.substr(colon + 2);
  }
  return "";
}

}  // namespace

std::string ProcessorName() {
  const std::string name = ProcessorField("model name");
  return name.empty() ? "unknown" : name;
}

std::vector<std::string> ProcessorFeatures() {
  constexpr std::pair<const char*, const char*> kNamed[] = {{"avx2", "AVX2"},
                                                            {"fma", "FMA"},
                                                            {"avx512f", "AVX-512"},
                                                            {"avx512_bf16", "AVX-512 BF16"},
                                                            {"amx_tile", "AMX"}};
  std::istringstream words(ProcessorField("flags"));
  std::set<std::string> flags;
  for (std::string flag; words >> flag;) flags.insert(flag);
  std::vector<std::string> features;
  for (const auto& [flag, name] : kNamed)
    if (flags.contains(flag)) features.push_back(name);
  return features;
}

}  // namespace antipode
