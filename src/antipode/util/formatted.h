#pragma once

#include <string>

namespace antipode {

/// Text by a printf format; numbers in the C locale.
[[gnu::format(printf, 1, 2)]] std::string Formatted(const char* format, ...);

}  // namespace antipode
