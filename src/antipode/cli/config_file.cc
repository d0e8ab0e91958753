#include "antipode/cli/config_file.h"

#include <CLI/Config.hpp>
#include <optional>
#include <sstream>

#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/quote.h"
#include "antipode/util/suggest.h"

namespace antipode {
namespace {

bool IsOption(const std::string& argument, const std::string& name) {
  return argument == name || argument.starts_with(name + "=");
}

std::optional<std::string> ConfigPath(const std::vector<std::string>& arguments) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i].starts_with("--config=")) return arguments[i].substr(9);
    if (arguments[i] == "--config" && i + 1 < arguments.size()) return arguments[i + 1];
  }
  return std::nullopt;
}

std::vector<CLI::ConfigItem> ReadItems(const std::string& path) {
  std::istringstream text(ReadFile(path));
  try {
    return CLI::ConfigTOML().from_config(text);
  } catch (const std::exception& error) {
    throw BadFile(path, "is no configuration file", "write lines such as: hypotheses = 3");
  }
}

bool IsSectionMark(const CLI::ConfigItem& item) { return item.name == "++" || item.name == "--"; }

bool BelongsTo(const CLI::ConfigItem& item, const CLI::App& command) {
  return item.parents.empty() || item.parents.back() == command.get_name();
}

std::vector<std::string> LongNames(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back(name);
  return names;
}

const CLI::Option& FindOption(const CLI::App& command, const std::string& name,
                              const std::string& path) {
  const CLI::Option* option = command.get_option_no_throw("--" + name);
  if (option != nullptr) return *option;
  const std::string nearest = NearestName(name, LongNames(command));
  throw BadFile(path, "sets " + Quoted(name) + ", which '" + command.get_name() + "' does not have",
                nearest.empty() ? "see 'antipode " + command.get_name() + " --help'"
                                : "did you mean " + nearest + "?");
}

bool IsGiven(const std::vector<std::string>& arguments, const std::string& option) {
  for (const std::string& argument : arguments)
    if (IsOption(argument, option)) return true;
  return false;
}

}  // namespace

std::vector<std::string> WithConfigFile(const CLI::App& command,
                                        const std::vector<std::string>& arguments) {
  const std::optional<std::string> path = ConfigPath(arguments);
  if (!path) return arguments;
  std::vector<std::string> merged;
  for (const CLI::ConfigItem& item : ReadItems(*path)) {
    if (IsSectionMark(item) || !BelongsTo(item, command)) continue;
    const CLI::Option& option = FindOption(command, item.name, *path);
    const std::string name = "--" + item.name;
    if (IsGiven(arguments, name)) continue;
    std::string value;
    for (const std::string& input : item.inputs) value += (value.empty() ? "" : ",") + input;
    const bool is_flag = option.get_items_expected_max() == 0;
    merged.push_back(is_flag && value == "true" ? name : name + "=" + value);
  }
  merged.insert(merged.end(), arguments.begin(), arguments.end());
  return merged;
}

}  // namespace antipode
