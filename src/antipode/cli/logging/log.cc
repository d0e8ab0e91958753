#include "antipode/cli/logging/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "antipode/util/error.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

spdlog::level::level_enum ParseLevel(const std::string& level) {
  if (level == "debug") return spdlog::level::debug;
  if (level == "info") return spdlog::level::info;
  if (level == "warning") return spdlog::level::warn;
  if (level == "error") return spdlog::level::err;
  throw InvalidOption("--log-level", Quoted(level) + " is unknown", "use debug, info, warning or error");
}

}  // namespace

void SetLogLevel(const std::string& level) {
  const spdlog::level::level_enum parsed = ParseLevel(level);
  auto logger = std::make_shared<spdlog::logger>("antipode", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
  logger->set_pattern("%^%l%$: %v");
  logger->set_level(parsed);
  spdlog::set_default_logger(logger);
}

void LogDebug(const std::string& message) { spdlog::debug(message); }
void LogInfo(const std::string& message) { spdlog::info(message); }

}  // namespace antipode
