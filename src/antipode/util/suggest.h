#pragma once

#include <string>
#include <vector>

namespace antipode {

/// The candidate nearest to a mistyped `name`, for "did you mean ...?"; empty if nothing is near.
/// Distance: insertions, deletions, substitutions and swaps of neighbours, letter case ignored;
/// near means at most one such edit for every three characters of `name`. The first of equals wins.
std::string NearestName(const std::string& name, const std::vector<std::string>& candidates);

/// "a, b, c".
std::string JoinNames(const std::vector<std::string>& names);

}  // namespace antipode
