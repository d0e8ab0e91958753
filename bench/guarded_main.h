#pragma once

#include <cstdio>
#include <exception>

namespace antipode {

/// Runs a program; errors go to standard error in one line.
inline int GuardedMain(const char* name, int (*run)(int, char**), int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", name, error.what());
    return 1;
  }
}

}  // namespace antipode
