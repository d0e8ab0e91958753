#include "antipode/util/interrupt.h"

#include <signal.h>
#include <unistd.h>

#include <atomic>

#include "antipode/util/error.h"

namespace antipode {
namespace {

// A signal handler can reach nothing but a global.
std::atomic<bool> interrupt_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void HandleSignal(int signal_number) {
  if (interrupt_requested.exchange(true)) _exit(128 + signal_number);
}

}  // namespace

void InstallInterruptHandler() {
  struct sigaction action = {};
  action.sa_handler = HandleSignal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool InterruptRequested() { return interrupt_requested; }

void ThrowIfInterrupted() {
  if (InterruptRequested()) throw Interrupted("antipode", "stopped on request");
}

}  // namespace antipode
