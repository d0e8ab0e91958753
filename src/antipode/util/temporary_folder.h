#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace antipode {

/// A new empty folder in the system's place for temporary files, removed with all it holds at the
/// end.
class TemporaryFolder {
 public:
  TemporaryFolder();  ///< @throws Error if it cannot be made
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder();

  const std::filesystem::path& path() const { return path_; }

  /// Path of a new file in it with these bytes.
  std::filesystem::path Write(const std::string& name, std::string_view bytes) const;

 private:
  std::filesystem::path path_;
};

}  // namespace antipode
