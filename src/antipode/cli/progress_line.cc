#include "antipode/cli/progress_line.h"

#include <unistd.h>

#include <algorithm>
#include <iostream>

#include "antipode/util/formatted.h"

namespace antipode {
namespace {

constexpr char kClearLine[] = "\r\033[K";
constexpr std::chrono::milliseconds kInterval(100);

std::string TimeText(double seconds) {
  const int whole = static_cast<int>(seconds + 0.5);
  if (whole < 60) return Formatted("%d s", whole);
  if (whole < 3600) return Formatted("%d min %02d s", whole / 60, whole % 60);
  return Formatted("%d h %02d min", whole / 3600, whole / 60 % 60);
}

std::string Bar(double share) {
  constexpr int kCells = 24;
  const int filled = static_cast<int>(std::clamp(share, 0.0, 1.0) * kCells);
  std::string bar(kCells, '.');
  std::fill_n(bar.begin(), filled, '#');
  return Formatted(" [%s] %3.0f %%", bar.c_str(), 100 * share);
}

}  // namespace

ProgressLine::ProgressLine(Mode mode) : is_visible_(mode == Mode::kAutomatic && isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
  if (is_visible_) std::cerr << kClearLine << std::flush;
}

void ProgressLine::Show(const Progress& progress) {
  if (!is_visible_) return;
  const auto now = std::chrono::steady_clock::now();
  const bool is_new_stage = stage_ != progress.stage;
  if (is_new_stage) {
    stage_ = progress.stage;
    stage_start_ = now;
  }
  if (!is_new_stage && now - last_shown_ < kInterval) return;
  last_shown_ = now;
  std::string line = progress.stage;
  if (progress.total > 0) {
    const double share = static_cast<double>(progress.done) / static_cast<double>(progress.total);
    line += Bar(share);
    const double elapsed = std::chrono::duration<double>(now - stage_start_).count();
    if (share > 0.01 && elapsed > 2) line += ", " + TimeText(elapsed / share - elapsed) + " left";
  }
  if (!progress.detail.empty()) line += ", " + progress.detail;
  std::cerr << kClearLine << line << std::flush;
}

}  // namespace antipode
