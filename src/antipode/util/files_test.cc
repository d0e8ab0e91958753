#include "antipode/util/files.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <cstdlib>
#include <fstream>
#include <optional>
#include <random>

#include "antipode/util/error.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

/// Sets an environment variable (or unsets it) until the end of the scope.
class ScopedVariable {
 public:
  ScopedVariable(const char* name, std::optional<std::string> value) : name_(name) {
    if (const char* const before = std::getenv(name)) before_ = before;
    Set(value);
  }
  ~ScopedVariable() { Set(before_); }

 private:
  void Set(const std::optional<std::string>& value) {
    if (value)
      setenv(name_, value->c_str(), 1);
    else
      unsetenv(name_);
  }
  const char* name_;
  std::optional<std::string> before_;
};

std::size_t CountFiles(const fs::path& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(Files, ReadReturnsWhatWasWritten) {
  const TemporaryFolder folder;
  std::mt19937 random(1);
  for (const std::size_t size : {0, 1, 4095, 1 << 20, (1 << 20) + 7}) {
    std::string content(size, '\0');
    for (char& c : content) c = static_cast<char>(random());
    WriteFileAtomically(folder.path() / "a" / "b" / "file", content);
    EXPECT_EQ(ReadFile(folder.path() / "a" / "b" / "file"), content);
    EXPECT_EQ(CountFiles(folder.path() / "a" / "b"), 1u);
  }
}

TEST(Files, ReadNamesWhatIsMissingOrAFolder) {
  const TemporaryFolder folder;
  EXPECT_THROW(ReadFile(folder.path()), BadFile);
  EXPECT_THROW(Sha256OfFile(folder.path()), BadFile);
  try {
    ReadFile(folder.path() / "nothing");
    FAIL();
  } catch (const BadFile& error) {
    EXPECT_NE(std::string(error.what()).find("nothing: does not exist"), std::string::npos);
  }
}

TEST(Files, FailureInTheWriterLeavesEverythingAsBefore) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "file";
  WriteFileAtomically(path, "before");
  const auto fail = [](std::ostream& stream) {
    stream << "half";
    throw Interrupted("test", "stopped");
  };
  EXPECT_THROW(WriteFileAtomically(path, fail), Interrupted);
  EXPECT_EQ(ReadFile(path), "before");
  EXPECT_EQ(CountFiles(folder.path()), 1u);
}

TEST(Files, FullDiskLeavesEverythingAsBefore) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "file";
  WriteFileAtomically(path, "before");
  rlimit before = {};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto old_handler = signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {1000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_THROW(WriteFileAtomically(path, std::string(100'000, 'x')), Error);
  EXPECT_THROW(WriteFileAtomically(path, std::string(1001, 'x')), Error);
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, old_handler);
  EXPECT_EQ(ReadFile(path), "before");
  EXPECT_EQ(CountFiles(folder.path()), 1u);
}

TEST(Files, WriteRefusesFoldersDevicesAndFilesAsFolders) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder.path() / "file", "x");
  EXPECT_THROW(WriteFileAtomically(folder.path(), "x"), Error);
  EXPECT_THROW(WriteFileAtomically(folder.path() / "", "x"), Error);
  EXPECT_THROW(WriteFileAtomically("/dev/null", "x"), Error);
  EXPECT_THROW(WriteFileAtomically(folder.path() / "file" / "below", "x"), Error);
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST(Files, WriteFollowsLinks) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder.path() / "real" / "file", "before");
  fs::create_symlink(folder.path() / "real" / "file", folder.path() / "link");
  WriteFileAtomically(folder.path() / "link", "after");
  EXPECT_TRUE(fs::is_symlink(folder.path() / "link"));
  EXPECT_EQ(ReadFile(folder.path() / "real" / "file"), "after");
}

TEST(Files, Sha256MatchesPublishedVectors) {
  const auto hash = [](const std::string& text) {
    return Sha256Hex(std::as_bytes(std::span(text)));
  };
  EXPECT_EQ(hash(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(hash("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  const std::string million(1'000'000, 'a');
  const char* const expected = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";
  EXPECT_EQ(hash(million), expected);
  const TemporaryFolder folder;
  WriteFileAtomically(folder.path() / "million", million);
  EXPECT_EQ(Sha256OfFile(folder.path() / "million"), expected);
}

TEST(Files, UserDataDirectoryFollowsTheEnvironment) {
  const ScopedVariable home("HOME", "/home/somebody");
  {
    const ScopedVariable data("XDG_DATA_HOME", "/data");
    EXPECT_EQ(UserDataDirectory(), "/data/antipode");
  }
  for (const std::optional<std::string>& ignored :
       {std::optional<std::string>(), std::optional<std::string>(""),
        std::optional<std::string>("relative")}) {
    const ScopedVariable data("XDG_DATA_HOME", ignored);
    EXPECT_EQ(UserDataDirectory(), "/home/somebody/.local/share/antipode");
  }
}

TEST(Files, ModelsDirectoryFollowsTheEnvironment) {
  {
    const ScopedVariable models("ANTIPODE_MODELS", "/somewhere");
    EXPECT_EQ(ModelsDirectory(), "/somewhere");
  }
  const ScopedVariable models("ANTIPODE_MODELS", std::nullopt);
  EXPECT_EQ(ModelsDirectory().filename(), "models");
  EXPECT_TRUE(ModelsDirectory().is_absolute());
}

}  // namespace
}  // namespace antipode
