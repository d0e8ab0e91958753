#include "antipode/util/interrupt.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include "antipode/util/error.h"

namespace antipode {
namespace {

/// Ends the process with 0 if a signal raises the flag and the flag stops the work.
[[noreturn]] void StopOn(int signal_number) {
  InstallInterruptHandler();
  if (InterruptRequested()) _exit(2);
  ThrowIfInterrupted();
  raise(signal_number);
  if (!InterruptRequested()) _exit(3);
  try {
    ThrowIfInterrupted();
  } catch (const Interrupted&) {
    _exit(0);
  }
  _exit(4);
}

[[noreturn]] void RaiseTwice(int signal_number) {
  InstallInterruptHandler();
  raise(signal_number);
  raise(signal_number);
  _exit(0);
}

TEST(InterruptDeathTest, FirstSignalStopsTheWork) {
  EXPECT_EXIT(StopOn(SIGINT), testing::ExitedWithCode(0), "");
  EXPECT_EXIT(StopOn(SIGTERM), testing::ExitedWithCode(0), "");
}

TEST(InterruptDeathTest, SecondSignalEndsTheProcess) {
  EXPECT_EXIT(RaiseTwice(SIGINT), testing::ExitedWithCode(130), "");
  EXPECT_EXIT(RaiseTwice(SIGTERM), testing::ExitedWithCode(143), "");
}

}  // namespace
}  // namespace antipode
