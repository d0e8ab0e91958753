#include "antipode/weights/archive.h"

#include <gtest/gtest.h>

#include "antipode/util/error.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

std::span<const std::byte> BytesOf(const std::string& text) { return std::as_bytes(std::span(text)); }

TEST(MakeZipArchive, IsReadBackAndDeflates) {
  const TemporaryFolder folder;
  const std::string zeros(10000, '0'), none;
  const std::vector<ZipEntry> entries{{"a", BytesOf(zeros)}, {"b c", BytesOf(zeros), ZipCompression::kNone}, {"empty", BytesOf(none)}};
  const std::string bytes = MakeZipArchive(entries);
  EXPECT_GT(bytes.size(), zeros.size());
  EXPECT_LT(bytes.size(), zeros.size() + 1000);
  const ZipArchive archive(InputFile(folder.Write("a.zip", bytes)));
  ASSERT_EQ(archive.entries().size(), 3u);
  EXPECT_EQ(archive.ReadText("a", 20000), zeros);
  EXPECT_EQ(archive.ReadText("b c", 20000), zeros);
  EXPECT_EQ(archive.ReadText("empty", 20000), "");
  EXPECT_EQ(MakeZipArchive(entries), bytes);
}

TEST(MakeZipArchive, RefusesNoEntriesAndTheSameNameTwice) {
  EXPECT_THROW(MakeZipArchive({}), Error);
  const std::string text = "x";
  const std::vector<ZipEntry> twice{{"a", BytesOf(text)}, {"a", BytesOf(text)}};
  EXPECT_THROW(MakeZipArchive(twice), Error);
}

}  // namespace
}  // namespace antipode
