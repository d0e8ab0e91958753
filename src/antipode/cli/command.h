#pragma once

#include <CLI/App.hpp>
#include <memory>
#include <string>
#include <vector>

namespace antipode {

/// One word of the program, such as `pose`: declares its options, then runs with their values.
class Command {
 public:
  virtual ~Command() = default;

  virtual std::string Name() const = 0;
  virtual std::string Summary() const = 0;  ///< for the list of commands, one line
  virtual std::string Example() const = 0;  ///< command lines that work as they are written
  virtual void DeclareOptions(CLI::App& app) = 0;

  /// Called once, after the options were parsed.
  virtual void Run() = 0;

  /// Commands below this one, such as `models list`; one of them runs instead of it.
  virtual std::vector<std::unique_ptr<Command>> Subcommands() const { return {}; }
};

std::unique_ptr<Command> MakePoseCommand();
std::unique_ptr<Command> MakeMatchCommand();
std::unique_ptr<Command> MakeReferenceCommand();
std::unique_ptr<Command> MakeOrientCommand();
std::unique_ptr<Command> MakeRenderCommand();
std::unique_ptr<Command> MakeSynthesizeCommand();
std::unique_ptr<Command> MakeEvaluateCommand();
std::unique_ptr<Command> MakeTrainCommand();
std::unique_ptr<Command> MakeModelsCommand();
std::unique_ptr<Command> MakeDoctorCommand();

}  // namespace antipode
