#include "antipode/weights/registry.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>

#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

/// For EXPECT_PRED2.
bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

class Registry : public testing::Test {
 protected:
  Registry() {
    setenv("ANTIPODE_MODELS", shipped_.c_str(), 1);
    setenv("XDG_DATA_HOME", folder_.path().c_str(), 1);
  }
  ~Registry() override {
    unsetenv("ANTIPODE_MODELS");
    unsetenv("XDG_DATA_HOME");
  }

  static TensorFile Weights(float value) {
    const float values[] = {value, 2, 3};
    TensorFile file;
    file.tensors["a"] = HostTensor::FromFloat({3}, values);
    file.metadata["source"] = "made by a test";
    return file;
  }

  ModelEntry Save(const std::filesystem::path& root, const std::string& name, float value = 1) {
    return SaveModel(root, name, Weights(value), "three numbers", "CC0", "# card\n");
  }

  template <typename Action>
  static std::string MessageOf(Action action) {
    try {
      action();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  TemporaryFolder folder_;
  std::filesystem::path shipped_ = folder_.path() / "shipped";
  std::filesystem::path imported_ = folder_.path() / "antipode" / "models";
};

TEST_F(Registry, WhatIsSavedIsListedFoundVerifiedAndLoaded) {
  const ModelEntry saved = Save(shipped_, "prior");
  Save(imported_, "another");
  const std::vector<ModelEntry> entries = ListModels();
  ASSERT_EQ(entries.size(), 2u);
  EXPECT_EQ(entries[0].name, "another");
  EXPECT_EQ(entries[1].name, "prior");
  const ModelEntry found = FindModel("prior");
  EXPECT_EQ(found.file, saved.file);
  EXPECT_EQ(found.sha256, saved.sha256);
  EXPECT_EQ(found.bytes, saved.bytes);
  EXPECT_EQ(found.tensor_count, 1u);
  EXPECT_EQ(found.description, "three numbers");
  EXPECT_EQ(found.licence, "CC0");
  EXPECT_EQ(found.source, "made by a test");
  EXPECT_NO_THROW(VerifyModel(found));
  EXPECT_EQ(LoadModel("prior").tensors.at("a").data, Weights(1).tensors.at("a").data);
  EXPECT_EQ(ReadFile(shipped_ / "prior" / "card.md"), "# card\n");
}

TEST_F(Registry, AnInterruptedSaveLeavesNoModelAndNoFile) {
  LazyTensorFile file = LazyCopyOf(Weights(1));
  file.tensors["b"] = {Dtype::kF32, {1}, []() -> HostTensor { throw Interrupted("import", "stopped"); }};
  EXPECT_THROW(SaveModel(imported_, "stopped", file, "", "", ""), Interrupted);
  EXPECT_TRUE(ListModels().empty());
  EXPECT_TRUE(std::filesystem::is_empty(imported_ / "stopped"));
}

TEST_F(Registry, NothingThereIsNoError) { EXPECT_TRUE(ListModels().empty()); }

TEST_F(Registry, ShippedModelsComeFirst) {
  Save(imported_, "prior", 7);
  Save(shipped_, "prior", 1);
  EXPECT_EQ(LoadModel("prior").tensors.at("a").ToDouble().at(0), 1);
  EXPECT_EQ(ListModels().size(), 1u);
}

TEST_F(Registry, UnknownNamesListTheKnownOnes) {
  EXPECT_PRED2(Contains, MessageOf([] { FindModel("prior"); }), "import");
  Save(shipped_, "prior");
  Save(imported_, "zero");
  const std::string message = MessageOf([] { FindModel("priro"); });
  EXPECT_PRED2(Contains, message, "did you mean 'prior'");
  EXPECT_PRED2(Contains, message, "prior, zero");
  EXPECT_NE(MessageOf([] { FindModel("../shipped/prior"); }), "");
}

TEST_F(Registry, EveryKindOfDamageIsFound) {
  const ModelEntry good = Save(shipped_, "prior");
  const std::string bytes = ReadFile(good.file);
  std::string flipped = bytes;
  flipped.back() ^= 1;
  WriteFileAtomically(good.file, flipped);
  EXPECT_PRED2(Contains, MessageOf([] { LoadModel("prior"); }), "sha256");
  WriteFileAtomically(good.file, bytes + "x");
  EXPECT_PRED2(Contains, MessageOf([&] { VerifyModel(good); }), "bytes instead of");
  std::filesystem::remove(good.file);
  EXPECT_PRED2(Contains, MessageOf([&] { VerifyModel(good); }), "cannot be read");
  WriteFileAtomically(good.file, bytes);
  EXPECT_NO_THROW(VerifyModel(good));
  ModelEntry other_count = good;
  other_count.tensor_count = 2;
  EXPECT_PRED2(Contains, MessageOf([&] { VerifyModel(other_count); }), "1 tensors instead of 2");
}

TEST_F(Registry, ValuesThatAreNotFiniteAreRefused) {
  const float bad = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(Save(shipped_, "prior", bad), BadFile);
  EXPECT_FALSE(std::filesystem::exists(shipped_));
  ModelEntry entry = Save(shipped_, "prior");
  WriteSafetensors(entry.file, Weights(bad));
  entry.sha256 = Sha256OfFile(entry.file);
  EXPECT_PRED2(Contains, MessageOf([&] { VerifyModel(entry); }), "not finite");
}

TEST_F(Registry, DamagedDescriptionsNameTheField) {
  Save(shipped_, "prior");
  const std::filesystem::path path = shipped_ / "prior" / "model.json";
  const std::string good = ReadFile(path);
  const auto refusal = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    WriteFileAtomically(path, text);
    return MessageOf([] { ListModels(); });
  };
  EXPECT_PRED2(Contains, refusal("\"bytes\"", "\"byte\""), "'bytes' is missing");
  EXPECT_PRED2(Contains, refusal("\"CC0\"", "7"), "'licence' is not a text");
  EXPECT_PRED2(Contains, refusal("\"tensors\": 1", "\"tensors\": -1"), "'tensors' is not a whole");
  EXPECT_PRED2(Contains, refusal("\"prior\"", "\"other\""), "'name' differs");
  EXPECT_PRED2(Contains, refusal("\"model.safetensors\"", "\"../model.safetensors\""), "'file'");
  EXPECT_PRED2(Contains, refusal("{", "["), "not a JSON object");
}

TEST_F(Registry, NamesThatAreNoNamesOfFilesAreRefused) {
  for (const char* const name : {"", ".", "..", "a/b", "../a", ".hidden", "a b", "a\n"}) {
    EXPECT_THROW(Save(shipped_, name), InvalidOption) << name;
  }
  EXPECT_FALSE(std::filesystem::exists(shipped_));
}

}  // namespace
}  // namespace antipode
