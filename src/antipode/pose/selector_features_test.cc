#include "antipode/pose/selector_features.h"

#include <gtest/gtest.h>

#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

constexpr char kSelector[] = "hash of the selector's weights";

class SelectorFeaturesTest : public testing::Test {
 protected:
  SelectorFeaturesTest() {
    torch::manual_seed(1);
    features_ = {torch::randn({10, 4, 4, 4}), torch::randn({10, 8, 2, 2})};
    WriteFileAtomically(folder_.path() / "reference.json", "a reference");
    KeepSelectorFeatures(folder_.path(), kSelector, features_);
  }

  std::filesystem::path File() const { return folder_.path() / "selector_features.safetensors"; }

  TemporaryFolder folder_;
  SelectorFeatures features_;
};

TEST_F(SelectorFeaturesTest, AreReadAsTheyWereKept) {
  const auto read = ReadSelectorFeatures(folder_.path(), kSelector);
  ASSERT_TRUE(read);
  ASSERT_EQ(read->size(), features_.size());
  for (std::size_t level = 0; level < features_.size(); ++level) EXPECT_TRUE(torch::equal(read->at(level), features_[level]));
}

TEST_F(SelectorFeaturesTest, OfAnotherSelectorAreNotRead) {
  EXPECT_FALSE(ReadSelectorFeatures(folder_.path(), "another hash"));
}

TEST_F(SelectorFeaturesTest, OfAnotherReferenceAreNotRead) {
  WriteFileAtomically(folder_.path() / "reference.json", "another reference");
  EXPECT_FALSE(ReadSelectorFeatures(folder_.path(), kSelector));
}

TEST_F(SelectorFeaturesTest, OneWrongByteAnywhereIsNoticed) {
  const std::string bytes = ReadFile(File());
  for (const std::size_t at : {std::size_t{3}, std::size_t{40}, bytes.size() / 2, bytes.size() - 1}) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    WriteFileAtomically(File(), damaged);
    EXPECT_FALSE(ReadSelectorFeatures(folder_.path(), kSelector)) << "byte " << at;
  }
  WriteFileAtomically(File(), bytes.substr(0, bytes.size() / 2));
  EXPECT_FALSE(ReadSelectorFeatures(folder_.path(), kSelector));
}

TEST_F(SelectorFeaturesTest, ThatAreTooLargeAreNotKept) {
  std::filesystem::remove(File());
  KeepSelectorFeatures(folder_.path(), kSelector, {torch::zeros({16'000'000})});
  EXPECT_FALSE(std::filesystem::exists(File()));
}

}  // namespace
}  // namespace antipode
