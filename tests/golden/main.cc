// antipode-golden DIR [--case NAME]: recomputes the golden vectors of DIR/golden.json and compares.

#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "antipode/util/error.h"
#include "catalogue.h"
#include "manifest.h"
#include "verdict.h"

namespace antipode::golden {
namespace {

constexpr int kNothingFailed = 0;
constexpr int kSomethingFailed = 1;
constexpr int kWrongUsage = 2;

struct Arguments {
  std::filesystem::path directory;
  std::optional<std::string> case_name;
};

int JudgeAll(const Arguments& arguments) {
  const std::vector<CatalogueEntry> catalogue = Catalogue();
  int judged = 0;
  bool failed = false;
  for (const GoldenCase& golden_case : ReadManifest(arguments.directory)) {
    if (arguments.case_name && *arguments.case_name != golden_case.name) continue;
    const Verdict verdict = Judge(catalogue, golden_case);
    std::printf("%s\n", verdict.line.c_str());
    std::fflush(stdout);
    failed = failed || verdict.outcome == Verdict::Outcome::kFail;
    ++judged;
  }
  if (judged == 0) {
    throw Error(arguments.case_name.value_or(arguments.directory.string()), "no such case",
                "see golden.json for the names");
  }
  return failed ? kSomethingFailed : kNothingFailed;
}

int Run(int argc, char** argv) {
  CLI::App app("Recomputes golden vectors and compares them.", "antipode-golden");
  Arguments arguments;
  app.add_option("DIR", arguments.directory, "folder with golden.json")->required();
  app.add_option("--case", arguments.case_name, "only the case of this name");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kNothingFailed : kWrongUsage;
  }
  try {
    return JudgeAll(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "antipode-golden: %s\n", error.what());
    return kSomethingFailed;
  }
}

}  // namespace
}  // namespace antipode::golden

int main(int argc, char** argv) { return antipode::golden::Run(argc, argv); }
