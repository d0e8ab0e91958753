#include "antipode/cli/common_options.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <iostream>
#include <opencv2/core/utility.hpp>
#include <thread>

#include "antipode/cli/logging/log.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"

namespace antipode {
namespace {

constexpr char kGroup[] = "Common options";
constexpr int kMaxThreads = 1024;

bool IsFlat(const nlohmann::ordered_json& json) {
  return std::ranges::none_of(json, [](const auto& value) { return value.is_structured(); });
}

std::string Indented(const nlohmann::ordered_json& json, const std::string& indent) {
  const bool is_flat_array = json.is_array() && IsFlat(json);
  if (!json.is_structured() || json.empty() || is_flat_array) return json.dump();
  const std::string inner = indent + "  ";
  std::string text;
  for (const auto& [key, value] : json.items()) {
    text += (text.empty() ? "\n" : ",\n") + inner;
    if (json.is_object()) text += nlohmann::json(key).dump() + ": ";
    text += Indented(value, inner);
  }
  return (json.is_object() ? "{" : "[") + text + "\n" + indent + (json.is_object() ? "}" : "]");
}

}  // namespace

void CommonOptions::Declare(CLI::App& app) {
  app.add_option("--json", json, "Write the result as JSON; - is standard output")
      ->type_name("FILE|-")->group(kGroup);
  app.add_option("--device", device, "auto, cpu or cuda")->capture_default_str()->type_name("NAME")->group(kGroup);
  app.add_option("--threads", threads, "Threads to use; 0: as many as processors")->capture_default_str()->type_name("N")->group(kGroup);
  app.add_option("--seed", seed, "Start of every random number")->capture_default_str()->type_name("N")->group(kGroup);
  app.add_flag("--quiet,-q", quiet, "Print nothing but errors")->group(kGroup);
  app.add_option("--log-level", log_level, "debug, info, warning or error")->capture_default_str()->type_name("LEVEL")->group(kGroup);
  app.add_option("--config", config, "File with lines `option = value`; the command line wins")
      ->type_name("FILE")->group(kGroup);
}

void CommonOptions::Apply() const {
  SetLogLevel(log_level);
  if (threads < 0 || threads > kMaxThreads)
    throw InvalidOption("--threads", "is " + std::to_string(threads),
                        "use 1 to " + std::to_string(kMaxThreads) + ", or 0 for as many as processors");
  if (device != "auto" && device != "cpu" && device != "cuda")
    throw InvalidOption("--device", "'" + device + "' is unknown", "use auto, cpu or cuda");
  if (threads == 0) return;
  at::set_num_threads(threads);
  cv::setNumThreads(threads);
}

int CommonOptions::ThreadCount() const {
  return threads > 0 ? threads : std::max(1u, std::thread::hardware_concurrency());
}

void CommonOptions::WriteJson(const nlohmann::ordered_json& result) const {
  if (!json) return;
  const std::string text = PrettyJson(result) + "\n";
  if (*json != "-") return WriteFileAtomically(*json, text);
  std::cout << text << std::flush;
  if (!std::cout) throw Error("standard output", "cannot be written");
}

std::string PrettyJson(const nlohmann::ordered_json& json) { return Indented(json, ""); }

}  // namespace antipode
