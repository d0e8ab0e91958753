#include "antipode/weights/safetensors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>

#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/check.h"

namespace antipode {
namespace {

/// For EXPECT_PRED2.
bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

constexpr Dtype kAllDtypes[] = {Dtype::kF64, Dtype::kF32, Dtype::kF16, Dtype::kBF16, Dtype::kI64,
                                Dtype::kI32, Dtype::kI16, Dtype::kI8,  Dtype::kU8,   Dtype::kBool};

HostTensor RandomTensor(std::mt19937& random) {
  HostTensor tensor;
  tensor.dtype = kAllDtypes[random() % std::size(kAllDtypes)];
  const std::size_t rank = random() % 5;
  for (std::size_t i = 0; i < rank; ++i) tensor.shape.push_back(random() % 5);
  tensor.data.resize(static_cast<std::size_t>(tensor.NumElements()) * SizeOf(tensor.dtype));
  for (std::byte& byte : tensor.data) byte = static_cast<std::byte>(random());
  return tensor;
}

TensorFile RandomFile(std::mt19937& random) {
  TensorFile file;
  const std::size_t count = random() % 12;
  for (std::size_t i = 0; i < count; ++i) {
    file.tensors["layer." + std::to_string(random() % 100) + ".größe\""] = RandomTensor(random);
  }
  if (random() % 2) file.metadata["format"] = "pt";
  return file;
}

void ExpectEqual(const TensorFile& a, const TensorFile& b) {
  EXPECT_EQ(a.metadata, b.metadata);
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) {
    const HostTensor& other = b.tensors.at(name);
    EXPECT_EQ(tensor.dtype, other.dtype);
    EXPECT_EQ(tensor.shape, other.shape);
    EXPECT_EQ(tensor.data, other.data);
  }
}

std::string WithLength(const std::string& header, const std::string& data) {
  std::string bytes(8, '\0');
  const std::uint64_t length = header.size();
  std::memcpy(bytes.data(), &length, sizeof(length));
  return bytes + header + data;
}

/// Without flushing to the disk. A new file, because some file systems flush one that is
/// overwritten.
void WriteQuickly(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::remove(path);
  std::ofstream(path, std::ios::binary) << bytes;
}

class Safetensors : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& bytes) const {
    WriteQuickly(path_, bytes);
    return path_;
  }

  /// The message with which the file is refused; empty if it is read.
  std::string Refusal(const std::string& bytes) const {
    try {
      SafetensorsReader(Write(bytes)).ReadAll();
    } catch (const BadFile& error) {
      return error.what();
    }
    return "";
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "weights.safetensors";
};

TEST_F(Safetensors, ReadsTheLayoutOfTheSpecification) {
  const std::string header =
      R"({"__metadata__":{"k":"v"},"b":{"shape":[2],"dtype":"I16","data_offsets":[4,8]},)"
      R"("a":{"dtype":"F32","shape":[],"data_offsets":[0,4]}}   )";
  const std::string data("\x00\x00\x80\x3f\x01\x00\xff\xff", 8);
  const SafetensorsReader reader(Write(WithLength(header, data)));
  EXPECT_EQ(reader.metadata().at("k"), "v");
  EXPECT_EQ(reader.Read("a").ToDouble(), std::vector<double>{1});
  EXPECT_EQ(reader.Read("b").ToDouble(), (std::vector<double>{1, -1}));
  EXPECT_THROW(reader.Read("c"), BadFile);
}

TEST_F(Safetensors, WritesTheLayoutOfTheSpecification) {
  TensorFile file;
  const float one[] = {1};
  file.tensors["a"] = HostTensor::FromFloat({1}, one);
  WriteSafetensors(path_, file);
  const std::string header = R"({"a":{"data_offsets":[0,4],"dtype":"F32","shape":[1]}})";
  const std::string padding((8 - header.size() % 8) % 8, ' ');
  EXPECT_EQ(ReadFile(path_), WithLength(header + padding, std::string("\x00\x00\x80\x3f", 4)));
}

TEST_F(Safetensors, RoundTripsEveryDtypeAndShape) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 random(seed);
    const TensorFile file = RandomFile(random);
    WriteSafetensors(path_, file);
    ExpectEqual(file, SafetensorsReader(path_).ReadAll());
  }
}

TEST_F(Safetensors, DamagedFilesAreReadOrRefused) {
  int refused = 0;
  std::string whole;
  for (unsigned seed = 0; seed < 600; ++seed) {
    std::mt19937 random(seed);
    if (seed % 30 == 0) {
      TensorFile file = RandomFile(random);
      file.tensors["one"] = RandomTensor(random);
      WriteSafetensors(path_, file);
      whole = ReadFile(path_);
    }
    std::string bytes = whole;
    const int edits = 1 + static_cast<int>(random() % 3);
    for (int edit = 0; edit < edits; ++edit) {
      const std::size_t position = random() % bytes.size();
      switch (random() % 4) {
        case 0:
          bytes[position] = static_cast<char>(random());
          break;
        case 1:
          bytes.erase(position, 1 + random() % 9);
          break;
        case 2:
          bytes.insert(position, 1 + random() % 9, "0123456789[]{},\" -e"[random() % 19]);
          break;
        default:
          bytes.resize(position + 1);
      }
    }
    refused += !Refusal(bytes).empty();
  }
  EXPECT_GT(refused, 300);
}

TEST_F(Safetensors, EveryTruncationIsRefused) {
  std::mt19937 random(5);
  TensorFile file;
  for (int i = 0; i < 3; ++i) file.tensors[std::to_string(i)] = RandomTensor(random);
  const float values[] = {1, 2};
  file.tensors["last"] = HostTensor::FromFloat({2}, values);
  WriteSafetensors(path_, file);
  const std::string whole = ReadFile(path_);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_NE(Refusal(whole.substr(0, size)), "") << size;
  }
}

std::string Entry(const std::string& name, const std::string& shape, const std::string& offsets) {
  std::string entry = R"("NAME":{"dtype":"U8","shape":SHAPE,"data_offsets":OFFSETS})";
  const std::pair<const char*, const std::string&> parts[] = {
      {"NAME", name}, {"SHAPE", shape}, {"OFFSETS", offsets}};
  for (const auto& [mark, text] : parts) entry.replace(entry.find(mark), std::strlen(mark), text);
  return entry;
}

TEST_F(Safetensors, RefusalsSayWhatIsWrong) {
  struct Case {
    std::string header;
    std::size_t data_bytes;
    std::string message;
  };
  const std::string a = Entry("a", "[4]", "[0,4]");
  const Case cases[] = {
      {"[]", 0, "not a JSON object"},
      {" {}", 0, "not a JSON object"},
      {"{", 0, "not valid JSON"},
      {"{}x", 0, "not valid JSON"},
      {"{" + a + ",}", 4, "not valid JSON"},
      {"{\"\xff\":{}}", 0, "not valid JSON"},
      {"{" + a + "," + a + "}", 4, "'a' appears twice"},
      {R"({"a":[]})", 0, "'a' is not described by an object"},
      {R"({"a":7})", 0, "'a' is not described by an object"},
      {R"({"__metadata__":{"k":7}})", 0, "'k' is not a text"},
      {R"({"__metadata__":{"k":"v","k":"w"}})", 0, "'k' appears twice"},
      {R"({"__metadata__":7})", 0, "is not described by an object"},
      {R"({"a":{"dtype":"F12","shape":[],"data_offsets":[0,4]}})", 4, "unsupported dtype 'F12'"},
      {R"({"a":{"dtype":7,"shape":[],"data_offsets":[0,4]}})", 4,
       "the number 7 in the field 'dtype'"},
      {R"({"a":{"dtype":"U8","shape":[]}})", 0, "lacks the field 'data_offsets'"},
      {R"({"a":{"shape":[],"data_offsets":[0,4]}})", 4, "lacks the field 'dtype'"},
      {R"({"a":{"dtype":"U8","dtype":"U8","shape":[],"data_offsets":[0,1]}})", 1, "twice"},
      {R"({"a":{"dtype":"U8","kind":1,"shape":[],"data_offsets":[0,1]}})", 1, "field 'kind'"},
      {"{" + Entry("a", "[-4]", "[0,4]") + "}", 4, "negative number -4"},
      {"{" + Entry("a", "[4.0]", "[0,4]") + "}", 4, "the number '4.0'"},
      {"{" + Entry("a", "[null]", "[0,4]") + "}", 4, "null"},
      {"{" + Entry("a", "[[4]]", "[0,4]") + "}", 4, "an array"},
      {"{" + Entry("a", "4", "[0,4]") + "}", 4, "the number 4 in the field 'shape'"},
      {"{" + Entry("a", "[18446744073709551615]", "[0,4]") + "}", 4, "impossible dimension"},
      {"{" + Entry("a", "[99999999999999999999]", "[0,4]") + "}", 4, "the number '9999"},
      {"{" + Entry("a", "[4294967296,4294967296,16]", "[0,4]") + "}", 4, "impossible shape"},
      {"{" + Entry("a", "[4611686018427387904,4]", "[0,0]") + "}", 0, "impossible shape"},
      {"{" + Entry("a", "[9223372036854775807,3,0]", "[0,0]") + "}", 0, "impossible shape"},
      {"{" + Entry("a", "[4]", "[4,0]") + "}", 4, "reversed"},
      {"{" + Entry("a", "[4]", "[0,4,4]") + "}", 4, "two data offsets"},
      {"{" + Entry("a", "[4]", "[0]") + "}", 4, "two data offsets"},
      {"{" + Entry("a", "[4]", "[1,5]") + "}", 4, "outside the file"},
      {"{" + Entry("a", "[4]", "[0,18446744073709551615]") + "}", 4, "outside the file"},
      {"{" + Entry("a", "[5]", "[0,4]") + "}", 4, "needs 5 bytes but has 4"},
      {"{" + a + "," + Entry("b", "[4]", "[2,6]") + "}", 6, "'b' overlaps"},
      {"{" + a + "," + Entry("b", "[4]", "[0,4]") + "}", 4, "overlaps"},
      {"{" + a + "," + Entry("b", "[4]", "[5,9]") + "}", 9, "hole before tensor 'b'"},
      {"{" + a + "}", 5, "1 bytes after the last tensor"},
      {"{}", 1, "1 bytes after the last tensor"},
  };
  for (const Case& one : cases) {
    const std::string refusal = Refusal(WithLength(one.header, std::string(one.data_bytes, 'x')));
    EXPECT_PRED2(Contains, refusal, one.message) << one.header;
    EXPECT_PRED2(Contains, refusal, "weights.safetensors") << one.header;
    EXPECT_EQ(refusal.find('\n'), std::string::npos);
  }
}

TEST_F(Safetensors, ImpossibleHeaderLengthsAreRefused) {
  for (const std::uint64_t length : {std::uint64_t{0}, std::uint64_t{3}, std::uint64_t{100'000'001},
                                     std::numeric_limits<std::uint64_t>::max()}) {
    std::string bytes = WithLength("{}", "");
    std::memcpy(bytes.data(), &length, sizeof(length));
    EXPECT_PRED2(Contains, Refusal(bytes), "not a safetensors file") << length;
  }
  EXPECT_PRED2(Contains, Refusal("1234567"), "too short");
  EXPECT_THROW(SafetensorsReader(folder_.path()), BadFile);
  EXPECT_THROW(SafetensorsReader(folder_.path() / "nothing"), BadFile);
  EXPECT_THROW(SafetensorsReader("/dev/zero"), BadFile);
}

TEST_F(Safetensors, DeepNestingIsRefused) {
  const std::string brackets(1'000'000, '[');
  EXPECT_PRED2(Contains, Refusal(WithLength("{\"a\":" + brackets, "")),
               "not described by an object");
}

TEST_F(Safetensors, FileThatShrinksAfterTheCheckIsRefused) {
  const float values[] = {1, 2};
  TensorFile file;
  file.tensors["a"] = HostTensor::FromFloat({2}, values);
  WriteSafetensors(path_, file);
  const SafetensorsReader reader(path_);
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) - 1);
  EXPECT_THROW(reader.ReadAll(), BadFile);
}

TEST_F(Safetensors, WriterRefusesContradictionsAndWritesNothing) {
  TensorFile file;
  file.tensors["a"] = {Dtype::kF32, {2}, std::vector<std::byte>(4)};
  EXPECT_THROW(WriteSafetensors(path_, file), Error);
  file.tensors["a"] = {Dtype::kF32, {-1, -1}, std::vector<std::byte>(4)};
  EXPECT_THROW(WriteSafetensors(path_, file), Error);
  file.tensors = {{"__metadata__", {}}};
  EXPECT_THROW(WriteSafetensors(path_, file), Error);
  file.tensors = {{"\xff", {Dtype::kU8, {1}, std::vector<std::byte>(1)}}};
  EXPECT_THROW(WriteSafetensors(path_, file), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

TEST(HostTensor, ToDoubleKnowsEveryDtype) {
  const auto value = [](Dtype dtype, std::uint64_t bits) {
    HostTensor tensor{dtype, {1}, std::vector<std::byte>(SizeOf(dtype))};
    std::memcpy(tensor.data.data(), &bits, tensor.data.size());
    return tensor.ToDouble().at(0);
  };
  EXPECT_EQ(value(Dtype::kF64, 0x3ff8000000000000), 1.5);
  EXPECT_EQ(value(Dtype::kF32, 0x3fc00000), 1.5);
  EXPECT_EQ(value(Dtype::kF16, 0x3e00), 1.5);
  EXPECT_EQ(value(Dtype::kBF16, 0x3fc0), 1.5);
  EXPECT_EQ(value(Dtype::kI64, ~std::uint64_t{1}), -2);
  EXPECT_EQ(value(Dtype::kI32, 0xfffffffe), -2);
  EXPECT_EQ(value(Dtype::kI16, 0xfffe), -2);
  EXPECT_EQ(value(Dtype::kI8, 0xfe), -2);
  EXPECT_EQ(value(Dtype::kU8, 0xfe), 254);
  EXPECT_EQ(value(Dtype::kBool, 1), 1);
}

TEST(HostTensor, FromFloatRefusesAWrongCount) {
  const float values[] = {1, 2, 3};
  EXPECT_THROW(HostTensor::FromFloat({2}, values), Error);
  EXPECT_EQ(HostTensor::FromFloat({3, 1}, values).ToDouble(), (std::vector<double>{1, 2, 3}));
}

TEST(HostTensor, ConversionsErrByHalfAStepAtMost) {
  std::mt19937 random(11);
  std::normal_distribution<float> normal;
  std::vector<float> values(1000);
  for (float& value : values) value = normal(random);
  const HostTensor source = HostTensor::FromFloat({10, 100}, values);
  const std::vector<double> exact = source.ToDouble();
  const std::pair<Dtype, double> cases[] = {
      {Dtype::kF64, 0}, {Dtype::kF32, 0}, {Dtype::kF16, 0x1p-11}, {Dtype::kBF16, 0x1p-8}};
  for (const auto& [dtype, half_step] : cases) {
    const HostTensor converted = ConvertTo(source, dtype);
    EXPECT_EQ(converted.dtype, dtype);
    EXPECT_EQ(converted.shape, source.shape);
    const std::vector<double> result = converted.ToDouble();
    for (std::size_t i = 0; i < exact.size(); ++i) {
      EXPECT_LE(std::abs(result[i] - exact[i]),
                half_step * std::abs(exact[i]) + 0x1p-25 * (half_step > 0));
    }
    // A wider dtype holds every narrow value, so that the way there and back changes nothing.
    EXPECT_EQ(ConvertTo(ConvertTo(converted, Dtype::kF64), dtype).data, converted.data);
  }
  EXPECT_THROW(ConvertTo(source, Dtype::kI32), Error);
  EXPECT_THROW(ConvertTo({Dtype::kU8, {}, std::vector<std::byte>(1)}, Dtype::kF32), Error);
}

TEST(CheckTensors, ListsEverythingThatDoesNotFit) {
  const float values[] = {1, 2, 3, 4};
  TensorFile file;
  file.tensors["right"] = HostTensor::FromFloat({2, 2}, values);
  file.tensors["turned"] = HostTensor::FromFloat({4, 1}, values);
  file.tensors["surplus"] = HostTensor::FromFloat({4}, values);
  const std::map<std::string, TensorShape> expected = {
      {"right", {2, 2}}, {"turned", {1, 4}}, {"absent", {7}}};
  try {
    CheckTensors(file, expected, "net.safetensors");
    FAIL();
  } catch (const BadFile& error) {
    EXPECT_PRED2(Contains, error.what(), "net.safetensors: ");
    EXPECT_PRED2(Contains, error.what(), "'turned' has shape [4, 1] instead of [1, 4]");
    EXPECT_PRED2(Contains, error.what(), "'surplus' does not belong there");
    EXPECT_PRED2(Contains, error.what(), "'absent' is missing");
    EXPECT_FALSE(Contains(error.what(), "right"));
  }
  EXPECT_NO_THROW(
      CheckTensors(file, {{"right", {2, 2}}, {"turned", {4, 1}}, {"surplus", {4}}}, "x"));
}

TEST(CheckTensors, ListsAtMostTwenty) {
  std::map<std::string, TensorShape> expected;
  for (int i = 100; i < 125; ++i) expected[std::to_string(i)] = {1};
  try {
    CheckTensors(TensorFile{}, expected, "x");
    FAIL();
  } catch (const BadFile& error) {
    EXPECT_PRED2(Contains, error.what(), "'119' is missing, and 5 more");
  }
}

TEST(CheckFinite, FindsEveryKindOfBadValueInEveryPlace) {
  constexpr double kBad[] = {std::numeric_limits<double>::infinity(),
                             -std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()};
  for (const Dtype dtype : {Dtype::kF64, Dtype::kF32, Dtype::kF16, Dtype::kBF16}) {
    for (const double bad : kBad) {
      for (std::size_t place = 0; place < 5; ++place) {
        std::vector<float> values = {0, -1, 65504, 1e-8f, 3};
        TensorFile file;
        file.tensors["a"] = ConvertTo(HostTensor::FromFloat({5}, values), dtype);
        EXPECT_NO_THROW(CheckFinite(file, "x"));
        values[place] = static_cast<float>(bad);
        file.tensors["a"] = ConvertTo(HostTensor::FromFloat({5}, values), dtype);
        EXPECT_THROW(CheckFinite(file, "x"), BadFile);
      }
    }
  }
}

}  // namespace
}  // namespace antipode
