#pragma once

#include <string>

namespace antipode {

/// Messages go to standard error from this level on. @throws InvalidOption unless `level` is debug, info,
/// warning or error
void SetLogLevel(const std::string& level);

void LogDebug(const std::string& message);
void LogInfo(const std::string& message);

}  // namespace antipode
