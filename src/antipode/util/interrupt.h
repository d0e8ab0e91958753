#pragma once

namespace antipode {

/// From now on SIGINT and SIGTERM only raise a flag, so that work can stop between two steps and
/// leave whole files behind. A second signal ends the process at once, with 128 + its number (130
/// for SIGINT).
void InstallInterruptHandler();

bool InterruptRequested();

/// @throws Interrupted once an interrupt was requested
void ThrowIfInterrupted();

}  // namespace antipode
