#include "antipode/weights/archive.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zip.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "antipode/util/error.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

constexpr char kDamaged[] = "the file is damaged, get it again";

std::string LastSystemError() { return std::strerror(errno); }

void CloseArchive(zip* archive) {
  if (archive) zip_discard(archive);
}

}  // namespace

InputFile::InputFile(const std::filesystem::path& path) : subject_(path.string()) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    throw BadFile(subject_, "does not exist", "check the spelling of the path");
  }
  if (!std::filesystem::is_regular_file(status)) {
    throw BadFile(subject_, "is not a regular file", "give the path of a checkpoint");
  }
  descriptor_ = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor_ < 0) {
    throw BadFile(subject_, "cannot be opened (" + LastSystemError() + ")",
                  "check the permissions");
  }
  MeasureSize();
}

InputFile::InputFile(int descriptor, std::string subject)
    : subject_(std::move(subject)), descriptor_(descriptor) {
  MeasureSize();
}

InputFile::InputFile(InputFile&& other) noexcept
    : subject_(std::move(other.subject_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_(other.size_) {}

InputFile::~InputFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

void InputFile::MeasureSize() {
  struct stat information = {};
  if (fstat(descriptor_, &information) == 0) {
    size_ = static_cast<std::uint64_t>(information.st_size);
  }
}

std::vector<std::byte> InputFile::Read(std::uint64_t offset, std::uint64_t count) const {
  if (offset > size_ || count > size_ - offset) throw BadFile(subject_, "ends too early", kDamaged);
  std::vector<std::byte> bytes(count);
  ReadInto(offset, bytes);
  return bytes;
}

std::string InputFile::ReadText(std::uint64_t offset, std::uint64_t count) const {
  if (offset > size_ || count > size_ - offset) throw BadFile(subject_, "ends too early", kDamaged);
  std::string text(count, '\0');
  ReadInto(offset, std::as_writable_bytes(std::span(text)));
  return text;
}

void InputFile::ReadInto(std::uint64_t offset, std::span<std::byte> target) const {
  while (!target.empty()) {
    const ssize_t count =
        pread(descriptor_, target.data(), target.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw BadFile(subject_, "cannot be read (" + LastSystemError() + ")");
    if (count == 0) throw BadFile(subject_, "ends too early", kDamaged);
    target = target.subspan(static_cast<std::size_t>(count));
    offset += static_cast<std::uint64_t>(count);
  }
}

/// One file of an archive, unpacked while it is read.
class ZipArchive::EntryStream {
 public:
  EntryStream(const ZipArchive& archive, const std::string& name)
      : subject_(archive.subject_ + ": " + Quoted(name)), stream_(nullptr, zip_fclose) {
    const auto found = archive.entries_.find(name);
    if (found == archive.entries_.end()) throw BadFile(subject_, "is missing", kDamaged);
    bytes_left_ = found->second.bytes;
    if (bytes_left_ > archive.unpacked_limit_) {
      throw BadFile(subject_, "would unpack to far more than weights do", kDamaged);
    }
    stream_.reset(zip_fopen_index(archive.archive_.get(), found->second.index, 0));
    if (!stream_) {
      throw BadFile(
          subject_,
          std::string("cannot be unpacked (") + zip_strerror(archive.archive_.get()) + ")",
          kDamaged);
    }
  }

  std::uint64_t bytes_left() const { return bytes_left_; }

  void Read(std::span<std::byte> target) {
    while (!target.empty()) {
      const zip_int64_t count = zip_fread(stream_.get(), target.data(), target.size());
      if (count <= 0) ThrowDamaged();
      target = target.subspan(static_cast<std::size_t>(count));
      bytes_left_ -= static_cast<std::uint64_t>(count);
    }
  }

  /// Only the read that meets the end compares the checksum.
  void Finish() {
    std::byte surplus;
    if (zip_fread(stream_.get(), &surplus, 1) != 0) ThrowDamaged();
  }

 private:
  [[noreturn]] void ThrowDamaged() const {
    throw BadFile(subject_, "cannot be unpacked (wrong length or checksum)", kDamaged);
  }

  std::string subject_;
  std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> stream_;
  std::uint64_t bytes_left_ = 0;
};

ZipArchive::ZipArchive(const InputFile& file)
    : subject_(file.subject()),
      unpacked_limit_(UnpackedLimit(file.size())),
      archive_(nullptr, CloseArchive) {
  const int descriptor = dup(file.descriptor());
  if (descriptor < 0) throw BadFile(subject_, "cannot be opened (" + LastSystemError() + ")");
  int error = 0;
  archive_.reset(zip_fdopen(descriptor, 0, &error));
  if (!archive_) {
    close(descriptor);
    throw BadFile(subject_, "is not a whole zip archive", kDamaged);
  }
  const zip_int64_t count = zip_get_num_entries(archive_.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    zip_stat_t information;
    const bool is_known =
        zip_stat_index(archive_.get(), static_cast<zip_uint64_t>(i), 0, &information) == 0 &&
        (information.valid & ZIP_STAT_NAME) && (information.valid & ZIP_STAT_SIZE);
    if (!is_known) throw BadFile(subject_, "has a damaged directory", kDamaged);
    const Entry entry{static_cast<std::uint64_t>(i), information.size};
    if (!entries_.emplace(information.name, entry).second) {
      throw BadFile(subject_, Quoted(information.name) + " appears twice", kDamaged);
    }
  }
}

std::vector<std::byte> ZipArchive::Read(const std::string& name) const {
  EntryStream stream(*this, name);
  std::vector<std::byte> bytes(stream.bytes_left());
  stream.Read(bytes);
  stream.Finish();
  return bytes;
}

std::string ZipArchive::ReadText(const std::string& name, std::uint64_t limit) const {
  EntryStream stream(*this, name);
  if (stream.bytes_left() > limit) {
    throw BadFile(subject_, Quoted(name) + " is larger than " + std::to_string(limit) + " bytes",
                  "save only the state_dict");
  }
  std::string text(stream.bytes_left(), '\0');
  stream.Read(std::as_writable_bytes(std::span(text)));
  stream.Finish();
  return text;
}

InputFile ZipArchive::Extract(const std::string& name) const {
  EntryStream stream(*this, name);
  const std::unique_ptr<FILE, int (*)(FILE*)> temporary(std::tmpfile(), std::fclose);
  if (!temporary) throw Error("temporary file", "cannot be made (" + LastSystemError() + ")");
  std::vector<std::byte> buffer(1 << 20);
  while (stream.bytes_left() > 0) {
    const std::size_t count = std::min<std::uint64_t>(buffer.size(), stream.bytes_left());
    stream.Read(std::span(buffer).first(count));
    if (std::fwrite(buffer.data(), 1, count, temporary.get()) != count) {
      throw Error("temporary file", "cannot be written (" + LastSystemError() + ")",
                  "free some space, or unpack " + Quoted(name) + " yourself");
    }
  }
  stream.Finish();
  if (std::fflush(temporary.get()) != 0) {
    throw Error("temporary file", "cannot be written (" + LastSystemError() + ")",
                "free some space, or unpack " + Quoted(name) + " yourself");
  }
  const int descriptor = dup(fileno(temporary.get()));
  if (descriptor < 0) throw Error("temporary file", "cannot be read (" + LastSystemError() + ")");
  return InputFile(descriptor, subject_ + ": " + Quoted(name));
}

namespace {

[[noreturn]] void ThrowNotMade(const char* reason) {
  throw Error("zip archive", std::string("cannot be made (") + reason + ")");
}

void AddEntry(zip* archive, const ZipEntry& entry) {
  constexpr zip_uint16_t kFirstOfJanuary1980 = 1 << 5 | 1;
  constexpr zip_uint32_t kBestCompression = 9;
  zip_source_t* source = zip_source_buffer(archive, entry.bytes.data(), entry.bytes.size(), 0);
  if (!source) ThrowNotMade(zip_strerror(archive));
  const zip_int64_t index = zip_file_add(archive, entry.name.c_str(), source, ZIP_FL_ENC_UTF_8);
  if (index < 0) {
    zip_source_free(source);
    ThrowNotMade(zip_strerror(archive));
  }
  const auto place = static_cast<zip_uint64_t>(index);
  const bool is_deflated = entry.compression == ZipCompression::kDeflate;
  const zip_int32_t method = is_deflated ? ZIP_CM_DEFLATE : ZIP_CM_STORE;
  if (zip_set_file_compression(archive, place, method, is_deflated ? kBestCompression : 0) != 0 ||
      zip_file_set_dostime(archive, place, 0, kFirstOfJanuary1980, 0) != 0) {
    ThrowNotMade(zip_strerror(archive));
  }
}

std::string ContentOf(zip_source_t* source) {
  zip_stat_t information;
  if (zip_source_stat(source, &information) != 0 || !(information.valid & ZIP_STAT_SIZE) ||
      zip_source_open(source) != 0) {
    ThrowNotMade(zip_error_strerror(zip_source_error(source)));
  }
  std::string content(information.size, '\0');
  const zip_int64_t count = zip_source_read(source, content.data(), content.size());
  zip_source_close(source);
  if (count != static_cast<zip_int64_t>(content.size())) ThrowNotMade("it ends too early");
  return content;
}

}  // namespace

std::string MakeZipArchive(std::span<const ZipEntry> entries) {
  if (entries.empty()) ThrowNotMade("it would hold no file");
  zip_error_t error;
  zip_error_init(&error);
  const std::unique_ptr<zip_source_t, void (*)(zip_source_t*)> target(
      zip_source_buffer_create(nullptr, 0, 0, &error), zip_source_free);
  if (!target) ThrowNotMade(zip_error_strerror(&error));
  std::unique_ptr<zip, void (*)(zip*)> archive(
      zip_open_from_source(target.get(), ZIP_CREATE | ZIP_TRUNCATE, &error), CloseArchive);
  if (!archive) ThrowNotMade(zip_error_strerror(&error));
  zip_source_keep(target.get());  // the archive, too, frees its source
  for (const ZipEntry& entry : entries) AddEntry(archive.get(), entry);
  if (zip_close(archive.get()) != 0) ThrowNotMade(zip_strerror(archive.get()));
  static_cast<void>(archive.release());
  return ContentOf(target.get());
}

std::uint64_t UnpackedLimit(std::uint64_t file_bytes) {
  constexpr std::uint64_t kAlwaysAllowed = 64 << 20;
  return kAlwaysAllowed + 8 * file_bytes;
}

}  // namespace antipode
