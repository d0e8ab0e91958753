#include "antipode/util/files.h"

#include <fcntl.h>
#include <openssl/evp.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <utility>
#include <vector>

#include "antipode/util/error.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

std::string LastSystemError() { return std::strerror(errno); }

std::ifstream OpenForReading(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) {
    throw BadFile(path.string(), "does not exist", "check the spelling of the path");
  }
  if (fs::is_directory(path, ignored)) {
    throw BadFile(path.string(), "is a folder", "give the path of a file");
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    throw BadFile(path.string(), "cannot be opened (" + LastSystemError() + ")",
                  "check the permissions");
  }
  return stream;
}

[[noreturn]] void ThrowUnreadable(const fs::path& path) {
  throw BadFile(path.string(), "cannot be read to its end", "check the disk and the permissions");
}

[[noreturn]] void ThrowUnwritable(const fs::path& path, const std::string& reason) {
  throw Error(path.string(), "cannot be written (" + reason + ")",
              "check the permissions and the free space, or choose another place");
}

/// A file of its own name in `folder` that vanishes with the object unless it was renamed.
class TemporaryFile {
 public:
  /// @param target the file to be replaced; only named in errors
  TemporaryFile(const fs::path& folder, const fs::path& target) : target_(target) {
    static std::atomic<unsigned> counter = 0;
    do {
      path_ = folder / (".antipode-" + std::to_string(getpid()) + "-" + std::to_string(counter++));
      descriptor_ = open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
    } while (descriptor_ < 0 && errno == EEXIST);
    if (descriptor_ < 0) ThrowUnwritable(target_, LastSystemError());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (descriptor_ >= 0) close(descriptor_);
    if (!renamed_) unlink(path_.c_str());
  }

  const fs::path& path() const { return path_; }

  void FlushToDisk() {
    if (fsync(descriptor_) != 0) ThrowUnwritable(target_, LastSystemError());
  }

  void RenameTo(const fs::path& path) {
    const int descriptor = std::exchange(descriptor_, -1);
    if (close(descriptor) != 0) ThrowUnwritable(target_, LastSystemError());
    if (std::rename(path_.c_str(), path.c_str()) != 0) ThrowUnwritable(target_, LastSystemError());
    renamed_ = true;
  }

 private:
  fs::path target_;
  fs::path path_;
  int descriptor_ = -1;
  bool renamed_ = false;
};

/// The file to replace: `path` with symbolic links followed.
fs::path ResolveTarget(const fs::path& path) {
  if (!path.has_filename()) throw Error(path.string(), "names a folder", "give the path of a file");
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) return path;
  if (fs::is_directory(status)) {
    throw Error(path.string(), "is a folder", "give the path of a file");
  }
  if (!fs::is_regular_file(status)) {
    throw Error(path.string(), "is not a regular file", "give the path of a file");
  }
  return fs::canonical(path);
}

fs::path FolderOf(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

void CreateFolder(const fs::path& folder, const fs::path& target) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) ThrowUnwritable(target, error.message());
}

/// Makes a rename last through a power cut; file systems that cannot do it are left alone.
void FlushFolder(const fs::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  fsync(descriptor);
  close(descriptor);
}

class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    Require(context_ && EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) == 1);
  }

  void Add(const void* bytes, std::size_t count) {
    Require(EVP_DigestUpdate(context_.get(), bytes, count) == 1);
  }

  std::string Hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
    unsigned int length = 0;
    Require(EVP_DigestFinal_ex(context_.get(), digest.data(), &length) == 1);
    constexpr char kDigits[] = "0123456789abcdef";
    std::string hex;
    for (unsigned int i = 0; i < length; ++i) {
      hex += kDigits[digest[i] >> 4];
      hex += kDigits[digest[i] & 15];
    }
    return hex;
  }

 private:
  static void Require(bool done) {
    if (!done)
      throw Error("SHA-256", "is not available in the OpenSSL library", "reinstall OpenSSL");
  }

  std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context_;
};

/// Empty if the variable is not set.
std::string EnvironmentVariable(const char* name) {
  const char* const value = std::getenv(name);
  return value ? value : "";
}

fs::path HomeDirectory() {
  const std::string home = EnvironmentVariable("HOME");
  if (!home.empty()) return home;
  passwd entry;
  passwd* found = nullptr;
  std::array<char, 4096> buffer;
  if (getpwuid_r(getuid(), &entry, buffer.data(), buffer.size(), &found) == 0 && found) {
    return found->pw_dir;
  }
  throw Error("HOME", "is not set and the account has no home folder", "set HOME or XDG_DATA_HOME");
}

}  // namespace

std::string ReadFile(const fs::path& path) {
  std::ifstream stream = OpenForReading(path);
  std::string content;
  std::vector<char> buffer(1 << 20);
  while (stream.read(buffer.data(), buffer.size()) || stream.gcount() > 0) {
    content.append(buffer.data(), stream.gcount());
  }
  if (stream.bad()) ThrowUnreadable(path);
  return content;
}

void WriteFileAtomically(const fs::path& path, const std::function<void(std::ostream&)>& write) {
  const fs::path target = ResolveTarget(path);
  const fs::path folder = FolderOf(target);
  CreateFolder(folder, target);
  TemporaryFile temporary(folder, target);
  {
    std::ofstream stream(temporary.path(), std::ios::binary);
    if (!stream) ThrowUnwritable(target, LastSystemError());
    write(stream);
    stream.close();
    if (!stream) ThrowUnwritable(target, LastSystemError());
  }
  temporary.FlushToDisk();
  temporary.RenameTo(target);
  FlushFolder(folder);
}

void WriteFileAtomically(const fs::path& path, std::string_view content) {
  WriteFileAtomically(path, [content](std::ostream& stream) {
    stream.write(content.data(), static_cast<std::streamsize>(content.size()));
  });
}

std::string Sha256Hex(std::span<const std::byte> bytes) {
  Sha256 hash;
  hash.Add(bytes.data(), bytes.size());
  return hash.Hex();
}

std::string Sha256OfFile(const fs::path& path) {
  std::ifstream stream = OpenForReading(path);
  Sha256 hash;
  std::vector<char> buffer(1 << 20);
  while (stream.read(buffer.data(), buffer.size()) || stream.gcount() > 0) {
    hash.Add(buffer.data(), static_cast<std::size_t>(stream.gcount()));
  }
  if (stream.bad()) ThrowUnreadable(path);
  return hash.Hex();
}

fs::path UserDataDirectory() {
  // A relative path here must be ignored (XDG Base Directory Specification).
  const fs::path data_home = EnvironmentVariable("XDG_DATA_HOME");
  if (data_home.is_absolute()) return data_home / "antipode";
  return HomeDirectory() / ".local" / "share" / "antipode";
}

fs::path ModelsDirectory() {
  const std::string chosen = EnvironmentVariable("ANTIPODE_MODELS");
  if (!chosen.empty()) return chosen;
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) {
    const fs::path installed = program.parent_path().parent_path() / "share/antipode/models";
    if (fs::is_directory(installed, error)) return installed;
  }
  return ANTIPODE_SOURCE_MODELS;
}

std::vector<std::filesystem::path> FilesWithExtension(const std::filesystem::path& folder,
                                                      const std::string& extension) {
  std::vector<std::filesystem::path> files;
  if (std::filesystem::is_directory(folder))
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      if (entry.path().extension() == extension) files.push_back(entry.path());
  if (files.empty())
    throw BadFile(folder.string(), "holds no " + extension + " file",
                  "name a folder of such files");
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace antipode
