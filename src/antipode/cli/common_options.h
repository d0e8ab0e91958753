#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "antipode/cli/progress_line.h"

namespace antipode {

/// Options that every command has.
struct CommonOptions {
  std::optional<std::string> json;  ///< file for the machine-readable result; "-" is standard output
  std::string device = "auto";      ///< auto, cpu or cuda
  int threads = 0;                  ///< 0: as many as processors
  std::uint64_t seed = 1;
  bool quiet = false;               ///< neither progress nor a result for people
  std::string log_level = "warning";
  std::string config;               ///< already merged into the command line by `WithConfigFile`

  void Declare(CLI::App& app);

  /// Sets the log level and the number of threads of every library. @throws InvalidOption
  void Apply() const;

  int ThreadCount() const;

  ProgressLine::Mode ProgressMode() const {
    return quiet ? ProgressLine::Mode::kSilent : ProgressLine::Mode::kAutomatic;
  }

  /// Whether to print for people: not if quiet or if standard output carries JSON.
  bool PrintsText() const { return !quiet && json != "-"; }

  /// Writes the result where `json` says, if anywhere.
  void WriteJson(const nlohmann::ordered_json& result) const;
};

/// JSON text, indented, arrays of numbers on one line.
std::string PrettyJson(const nlohmann::ordered_json& json);

}  // namespace antipode
