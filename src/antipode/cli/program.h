#pragma once

#include <string>
#include <vector>

namespace antipode {

/// The command-line program: parses, runs one command, prints.
/// @param arguments without the program's name
/// @return 0 done, 1 the work failed, 2 wrong usage, 130 interrupted; the reason of a failure is one
/// line on standard error
int RunProgram(const std::vector<std::string>& arguments);

}  // namespace antipode
