#include "antipode/util/memory_map.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <utility>

#include "antipode/util/error.h"

namespace antipode {

MemoryMap::MemoryMap(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) throw BadFile(path.string(), "cannot be opened", "check the path");
  struct stat status = {};
  void* address = MAP_FAILED;
  if (::fstat(descriptor, &status) == 0 && status.st_size > 0)
    address = ::mmap(nullptr, status.st_size, PROT_READ, MAP_SHARED, descriptor, 0);
  ::close(descriptor);
  if (address == MAP_FAILED) throw BadFile(path.string(), "is empty or cannot be mapped into memory");
  bytes_ = {static_cast<const std::byte*>(address), static_cast<std::size_t>(status.st_size)};
}

MemoryMap::~MemoryMap() {
  if (!bytes_.empty())
    ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());  // munmap takes a non-const pointer
}

MemoryMap::MemoryMap(MemoryMap&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}

}  // namespace antipode
