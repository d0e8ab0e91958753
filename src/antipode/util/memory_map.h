#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

namespace antipode {

/// A file mapped into memory for reading.
class MemoryMap {
 public:
  /// @throws BadFile naming the file if it is missing or cannot be mapped
  explicit MemoryMap(const std::filesystem::path& path);
  ~MemoryMap();
  MemoryMap(MemoryMap&& other) noexcept;
  MemoryMap& operator=(MemoryMap&&) = delete;

  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::span<const std::byte> bytes_;
};

}  // namespace antipode
