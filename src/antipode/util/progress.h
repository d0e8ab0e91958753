#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace antipode {

/// A state of some long work, reported by the layer that does it and drawn by the one that has a terminal.
struct Progress {
  std::string stage;        ///< what is being done, e.g. "rendering views"
  std::int64_t done = 0;    ///< units finished
  std::int64_t total = 0;   ///< units in all; 0 if unknown
  std::string detail;       ///< short extra text, e.g. "loss 3.21"
};

/// Called from the thread that does the work. May throw `Interrupted` to stop it.
using ProgressCallback = std::function<void(const Progress&)>;

}  // namespace antipode
