#pragma once

#include <chrono>
#include <string>

#include "antipode/util/progress.h"

namespace antipode {

/// One line on standard error that shows how far the work is; only where that is a terminal.
class ProgressLine {
 public:
  enum class Mode { kAutomatic, kSilent };

  explicit ProgressLine(Mode mode);
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;
  ~ProgressLine();  ///< clears the line

  void Show(const Progress& progress);

 private:
  bool is_visible_;
  std::string stage_;
  std::chrono::steady_clock::time_point stage_start_, last_shown_;
};

}  // namespace antipode
