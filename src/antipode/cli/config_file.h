#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

namespace antipode {

/// Adds the options of the file behind `--config` that the command line does not have itself.
/// The file has lines `name = value` (TOML or INI, names without dashes); a section `[pose]` counts
/// for that command only, lines before the first section count for all.
/// @param command the command the arguments belong to
/// @param arguments those behind the command's name
/// @throws BadFile naming the file and an option the command does not have
std::vector<std::string> WithConfigFile(const CLI::App& command,
                                        const std::vector<std::string>& arguments);

}  // namespace antipode
