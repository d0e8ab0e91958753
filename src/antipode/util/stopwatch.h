#pragma once

#include <chrono>
#include <utility>

namespace antipode {

/// Measures time from its construction.
class Stopwatch {
 public:
  double Seconds() const { return Between(start_, Clock::now()); }

  /// Seconds since the last lap, or the start.
  double Lap() {
    const auto now = Clock::now();
    return Between(std::exchange(last_lap_, now), now);
  }

 private:
  using Clock = std::chrono::steady_clock;
  static double Between(Clock::time_point from, Clock::time_point to) { return std::chrono::duration<double>(to - from).count(); }

  Clock::time_point start_ = Clock::now(), last_lap_ = start_;
};

}  // namespace antipode
