#include "antipode/cli/program.h"

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <cctype>
#include <iostream>
#include <new>

#include "antipode/cli/command.h"
#include "antipode/cli/config_file.h"
#include "antipode/cli/usage_error.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/quote.h"
#include "antipode/util/suggest.h"
#include "antipode/util/version.h"

namespace antipode {
namespace {

enum ExitCode { kDone = 0, kFailed = 1, kWrongUsage = 2, kInterrupted = 130 };

/// A command and where its options live.
struct DeclaredCommand {
  std::unique_ptr<Command> command;
  CLI::App* app = nullptr;
};

class CommandTable {
 public:
  CommandTable() : root_("Relative camera pose of two photographs of one object.", "antipode") {
    root_.set_version_flag("--version", std::string("antipode ") + Version());
    root_.footer("'antipode COMMAND --help' tells more, with an example.");
    root_.require_subcommand(1);
    Declare(root_, MakePoseCommand());
    Declare(root_, MakeMatchCommand());
    Declare(root_, MakeReferenceCommand());
    Declare(root_, MakeOrientCommand());
    Declare(root_, MakeSynthesizeCommand());
    Declare(root_, MakeRenderCommand());
    Declare(root_, MakeEvaluateCommand());
    Declare(root_, MakeTrainCommand());
    Declare(root_, MakeModelsCommand());
    Declare(root_, MakeDoctorCommand());
  }

  CLI::App& root() { return root_; }

  Command& ParsedCommand() const {
    const auto parsed = std::ranges::find_if(commands_, [](const DeclaredCommand& declared) {
      return declared.app->parsed() && declared.app->get_subcommands().empty();
    });
    return *parsed->command;
  }

 private:
  void Declare(CLI::App& parent, std::unique_ptr<Command> command) {
    CLI::App* app = parent.add_subcommand(command->Name(), command->Summary());
    app->footer("Example:\n" + command->Example());
    command->DeclareOptions(*app);
    std::vector<std::unique_ptr<Command>> subcommands = command->Subcommands();
    if (!subcommands.empty()) app->require_subcommand(1);
    for (auto& subcommand : subcommands) Declare(*app, std::move(subcommand));
    commands_.push_back({std::move(command), app});
  }

  CLI::App root_;
  std::vector<DeclaredCommand> commands_;
};

std::vector<CLI::App*> CommandsOf(CLI::App& app) {
  return app.get_subcommands([](CLI::App*) { return true; });
}

std::string FullName(const CLI::App& app) {
  return app.get_parent() == nullptr ? app.get_name() : FullName(*app.get_parent()) + " " + app.get_name();
}

std::string HelpHint(const CLI::App& app) { return "see '" + FullName(app) + " --help'"; }

bool LooksLikeOption(const std::string& argument) {
  return argument.size() > 1 && argument[0] == '-' && argument[1] != '.' &&
         !std::isdigit(static_cast<unsigned char>(argument[1]));
}

[[noreturn]] void ThrowUnknownCommand(CLI::App& app, const std::string& name) {
  std::vector<std::string> names;
  for (const CLI::App* command : CommandsOf(app)) names.push_back(command->get_name());
  const std::string nearest = NearestName(name, names);
  throw UsageError("command " + Quoted(name), "is unknown",
                   nearest.empty() ? HelpHint(app) : "did you mean '" + nearest + "'?");
}

[[noreturn]] void ThrowUnknownOption(const CLI::App& app, const std::string& name) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& known : option->get_lnames()) names.push_back("--" + known);
  const std::string nearest = NearestName(name, names);
  throw UsageError("option " + Quoted(name), "is unknown to '" + FullName(app) + "'",
                   nearest.empty() ? HelpHint(app) : "did you mean " + nearest + "?");
}

/// The library that parses would report a mistyped option as a surplus file name, or not at all.
void CheckOptionNames(const CLI::App& app, const std::vector<std::string>& arguments) {
  for (std::size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    if (!LooksLikeOption(arguments[i])) continue;
    const std::size_t equals = arguments[i].find('=');
    const std::string name = arguments[i].substr(0, equals);
    const CLI::Option* option = app.get_option_no_throw(name);
    if (option == nullptr) ThrowUnknownOption(app, name);
    const bool value_follows = equals == std::string::npos && option->get_items_expected_min() > 0;
    if (value_follows) ++i;
  }
}

/// Checks the names of command and options, and merges the configuration file.
std::vector<std::string> CheckedArguments(CLI::App& root, const std::vector<std::string>& arguments) {
  CLI::App* app = &root;
  std::size_t first = 0;
  for (; first < arguments.size() && !CommandsOf(*app).empty(); ++first) {
    if (LooksLikeOption(arguments[first])) break;
    const std::vector<CLI::App*> commands = CommandsOf(*app);
    const auto next = std::ranges::find(commands, arguments[first], &CLI::App::get_name);
    if (next == commands.end()) ThrowUnknownCommand(*app, arguments[first]);
    app = *next;
  }
  const std::vector<std::string> rest(arguments.begin() + static_cast<std::ptrdiff_t>(first), arguments.end());
  CheckOptionNames(*app, rest);
  std::vector<std::string> checked(arguments.begin(), arguments.begin() + static_cast<std::ptrdiff_t>(first));
  const std::vector<std::string> merged = WithConfigFile(*app, rest);
  checked.insert(checked.end(), merged.begin(), merged.end());
  return checked;
}

std::string FirstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

int Fail(const std::string& message, ExitCode code) {
  const std::string prefix = "antipode: ";
  std::cerr << (message.starts_with(prefix) ? "" : prefix) << FirstLine(message) << std::endl;
  return code;
}

CLI::App& LastParsed(CLI::App& root) {
  CLI::App* app = &root;
  while (!app->get_subcommands().empty()) app = app->get_subcommands().front();
  return *app;
}

int RunCommand(CommandTable& table, const std::vector<std::string>& arguments) {
  CLI::App& root = table.root();
  if (arguments.empty()) {
    std::cerr << root.help();
    return kWrongUsage;
  }
  try {
    std::vector<std::string> checked = CheckedArguments(root, arguments);
    std::ranges::reverse(checked);
    root.parse(std::move(checked));
  } catch (const CLI::Success& request) {
    return root.exit(request);
  } catch (const CLI::ParseError& error) {
    return Fail(FirstLine(error.what()) + "; " + HelpHint(LastParsed(root)), kWrongUsage);
  }
  table.ParsedCommand().Run();
  return kDone;
}

}  // namespace

int RunProgram(const std::vector<std::string>& arguments) {
  InstallInterruptHandler();
  try {
    CommandTable table;
    return RunCommand(table, arguments);
  } catch (const Interrupted& error) {
    return Fail(error.what(), kInterrupted);
  } catch (const UsageError& error) {
    return Fail(error.what(), kWrongUsage);
  } catch (const InvalidOption& error) {
    return Fail(error.what(), kWrongUsage);
  } catch (const Error& error) {
    return Fail(error.what(), kFailed);
  } catch (const std::bad_alloc&) {
    return Fail("out of memory; use smaller pictures or close other programs", kFailed);
  } catch (const std::exception& error) {
    return Fail(std::string("internal error: ") + error.what(), kFailed);
  }
}

}  // namespace antipode
