#include "antipode/util/error.h"

namespace antipode {
namespace {

std::string OneLine(const std::string& subject, const std::string& problem,
                    const std::string& remedy) {
  std::string line = subject + ": " + problem;
  if (!remedy.empty()) line += "; " + remedy;
  return line;
}

}  // namespace

Error::Error(const std::string& subject, const std::string& problem, const std::string& remedy)
    : std::runtime_error(OneLine(subject, problem, remedy)) {}

}  // namespace antipode
