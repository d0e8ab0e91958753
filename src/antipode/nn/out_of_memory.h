#pragma once

#include <exception>

namespace antipode {

/// Whether an error of LibTorch or the standard library says that memory ran out, on the CPU or another device.
bool IsOutOfMemory(const std::exception& error);

}  // namespace antipode
