#include "antipode/cli/process_clock.h"

#include <time.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>

namespace antipode {
namespace {

const auto libraries_loaded = std::chrono::steady_clock::now();

/// Field 22 of /proc/self/stat, in clock ticks since the system started.
std::optional<double> StartSecondsAfterBoot() {
  std::ifstream file("/proc/self/stat");
  const std::string text(std::istreambuf_iterator<char>(file), {});
  const std::size_t name_end = text.rfind(')');
  if (name_end == std::string::npos) return std::nullopt;
  std::istringstream fields(text.substr(name_end + 1));
  std::string ignored;
  for (int field = 3; field < 22; ++field) fields >> ignored;
  double ticks = 0;
  if (!(fields >> ticks) || ticks <= 0) return std::nullopt;
  return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

}  // namespace

double SecondsSinceProcessStart() {
  const double since_loaded =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - libraries_loaded).count();
  const std::optional<double> start = StartSecondsAfterBoot();
  timespec now{};
  if (!start || clock_gettime(CLOCK_BOOTTIME, &now) != 0) return since_loaded;
  const double age = static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) - *start;
  // The two clocks disagree where processes live in a clock namespace of their own.
  constexpr double kLongestLoading = 60;
  const bool is_plausible = age >= since_loaded && age < since_loaded + kLongestLoading;
  return is_plausible ? age : since_loaded;
}

}  // namespace antipode
