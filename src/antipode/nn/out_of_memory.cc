#include "antipode/nn/out_of_memory.h"

#include <new>
#include <string_view>

#include <c10/util/Exception.h>

namespace antipode {

bool IsOutOfMemory(const std::exception& error) {
  if (dynamic_cast<const c10::OutOfMemoryError*>(&error) != nullptr || dynamic_cast<const std::bad_alloc*>(&error) != nullptr) return true;
  // LibTorch's allocator for the CPU has no error class of its own.
  const auto* const torch_error = dynamic_cast<const c10::Error*>(&error);
  return torch_error != nullptr && std::string_view(torch_error->what_without_backtrace()).find("CPUAllocator") != std::string_view::npos;
}

}  // namespace antipode
