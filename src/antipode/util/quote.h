#pragma once

#include <string>
#include <string_view>

namespace antipode {

/// Untrusted text for an error message: in single quotes, on one line, control characters and bytes
/// outside ASCII as '?', at most 120 characters.
std::string Quoted(std::string_view text);

}  // namespace antipode
