#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

struct zip;

namespace antipode {

/// A regular file read at any place; every failure throws BadFile naming `subject()`.
class InputFile {
 public:
  explicit InputFile(const std::filesystem::path& path);
  /// Takes over an open descriptor of a regular file.
  InputFile(int descriptor, std::string subject);
  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&&) = delete;
  ~InputFile();

  const std::string& subject() const { return subject_; }
  std::uint64_t size() const { return size_; }
  int descriptor() const { return descriptor_; }
  /// @throws BadFile if the range does not lie in the file
  std::vector<std::byte> Read(std::uint64_t offset, std::uint64_t count) const;
  std::string ReadText(std::uint64_t offset, std::uint64_t count) const;

 private:
  void ReadInto(std::uint64_t offset, std::span<std::byte> target) const;
  void MeasureSize();

  std::string subject_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
};

/// The files in a zip archive, by name.
class ZipArchive {
 public:
  struct Entry {
    std::uint64_t index = 0;
    std::uint64_t bytes = 0;  ///< unpacked, as the archive claims
  };

  /// @throws BadFile if it is not a whole zip archive, or an entry appears twice
  explicit ZipArchive(const InputFile& file);

  const std::map<std::string, Entry>& entries() const { return entries_; }
  /// A file that unpacks to more than this is refused: 64 MiB and eight times the archive.
  std::uint64_t unpacked_limit() const { return unpacked_limit_; }
  /// @throws BadFile if it is not there, is damaged or exceeds `unpacked_limit()`
  std::vector<std::byte> Read(const std::string& name) const;
  std::string ReadText(const std::string& name, std::uint64_t limit) const;
  /// Unpacks to a nameless temporary file.
  InputFile Extract(const std::string& name) const;

 private:
  class EntryStream;

  std::string subject_;
  std::uint64_t unpacked_limit_ = 0;
  std::unique_ptr<zip, void (*)(zip*)> archive_;
  std::map<std::string, Entry> entries_;
};

enum class ZipCompression { kNone, kDeflate };

struct ZipEntry {
  std::string name;
  std::span<const std::byte> bytes;
  ZipCompression compression = ZipCompression::kDeflate;
};

/// A zip archive of these files, all dated 1980-01-01: the same entries give the same bytes.
/// @throws Error if there are none, or two have the same name
std::string MakeZipArchive(std::span<const ZipEntry> entries);

/// How much may be unpacked from, or copied out of, a file of `file_bytes`: weights hardly
/// compress.
std::uint64_t UnpackedLimit(std::uint64_t file_bytes);

}  // namespace antipode
