#include <cmath>
#include <filesystem>
#include <limits>

#include <gtest/gtest.h>
#include <unistd.h>

#include "catalogue.h"
#include "comparison.h"
#include "manifest.h"
#include "verdict.h"

namespace antipode::golden {
namespace {

using nlohmann::json;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

NumericTensor Vector(std::vector<double> values) {
  NumericTensor tensor({static_cast<std::int64_t>(values.size())});
  tensor.values = std::move(values);
  return tensor;
}

double RatioOf(const NumericTensor& result, const NumericTensor& expected, const json& attributes) {
  return Compare(result, expected).RatioTo(ToleranceOf({"tensor", "expected", attributes}));
}

GoldenCase Named(const std::string& name, const std::string& kind = "") {
  GoldenCase golden_case;
  golden_case.name = name;
  golden_case.kind = kind;
  return golden_case;
}

/// A folder whose stored expectation can be changed.
class GoldenFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() / ("antipode-golden-" + std::to_string(::getpid()));
    std::filesystem::remove_all(folder_);
    std::filesystem::copy(ANTIPODE_GOLDEN_DATA, folder_, std::filesystem::copy_options::recursive);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  GoldenCase Case(const std::string& name) const {
    for (GoldenCase& golden_case : ReadManifest(folder_)) {
      if (golden_case.name == name) return golden_case;
    }
    return {};
  }

  std::filesystem::path folder_;
};

TEST(Comparison, HoldsUpToTheAbsoluteTolerance) {
  EXPECT_LE(RatioOf(Vector({1, 2}), Vector({1, 2.5}), {{"atol", 0.5}}), 1);
  EXPECT_GT(RatioOf(Vector({1, 2}), Vector({1, 2.75}), {{"atol", 0.5}}), 1);
}

TEST(Comparison, ExactMeansEqual) {
  EXPECT_LE(RatioOf(Vector({3}), Vector({3}), {{"tolerance", "exact"}}), 1);
  EXPECT_GT(RatioOf(Vector({3}), Vector({3 + 1e-15}), {{"tolerance", "exact"}}), 1);
  EXPECT_GT(RatioOf(Vector({3}), Vector({4}), {{"tolerance", {{"kind", "exact"}}}}), 1);
}

TEST(Comparison, NaNEqualsOnlyNaN) {
  EXPECT_LE(RatioOf(Vector({kNaN, 1}), Vector({kNaN, 1}), {{"atol", 1e-9}}), 1);
  EXPECT_GT(RatioOf(Vector({kNaN, 1}), Vector({1, 1}), {{"atol", 1e9}}), 1);
  EXPECT_GT(RatioOf(Vector({1, 1}), Vector({kNaN, 1}), {{"atol", 1e9}}), 1);
  EXPECT_GT(RatioOf(Vector({kNaN}), Vector({1}), {{"atol", 2}, {"dtype", "U8"}}), 1);
}

TEST(Comparison, ShapesMustAgree) {
  EXPECT_GT(RatioOf(Vector({1}), Vector({1, 1}), {{"atol", 1e9}}), 1);
  NumericTensor row({1, 2}), column({2, 1});
  row.values = column.values = {1, 2};
  EXPECT_GT(RatioOf(row, column, {{"atol", 1e9}}), 1);
}

TEST(Comparison, FloatToleranceLimitsBothNorms) {
  const json tolerance = {{"tolerance", {{"kind", "float"}, {"max_abs", 0.1}, {"rel_l2", 0.01}}}};
  EXPECT_LE(RatioOf(Vector({10, 10}), Vector({10, 10.05}), tolerance), 1);
  EXPECT_GT(RatioOf(Vector({10, 10}), Vector({10, 10.2}), tolerance), 1);
  EXPECT_GT(RatioOf(Vector({1, 1}), Vector({1, 1.05}), tolerance), 1);
}

TEST(Comparison, GreyLevelsLimitTheShareOfDifferentPixels) {
  const json tolerance = {
      {"tolerance", {{"kind", "grey_levels"}, {"max_abs", 1}, {"max_fraction_different", 0.25}}}};
  EXPECT_LE(RatioOf(Vector({5, 6, 7, 8}), Vector({5, 6, 7, 9}), tolerance), 1);
  EXPECT_GT(RatioOf(Vector({5, 6, 7, 8}), Vector({5, 6, 8, 9}), tolerance), 1);
  EXPECT_GT(RatioOf(Vector({5, 6, 7, 8}), Vector({5, 6, 7, 10}), tolerance), 1);
  const json picture = {{"tolerance", "8-bit image: max 3 grey levels"}};
  EXPECT_LE(RatioOf(Vector({5}), Vector({8}), picture), 1);
  EXPECT_GT(RatioOf(Vector({5}), Vector({9}), picture), 1);
}

TEST(Comparison, UnknownTolerancesAreRefused) {
  EXPECT_ANY_THROW(ToleranceOf({"tensor", "expected", json::object()}));
  EXPECT_ANY_THROW(ToleranceOf({"tensor", "expected", {{"tolerance", "roughly"}}}));
}

TEST(CatalogueLookup, ByKindThenByNameThenBySignature) {
  const std::vector<CatalogueEntry> catalogue = {
      {"unet", {"x"}, nullptr}, {"unet_wide", {"y"}, nullptr}, {"selector", {"z"}, nullptr}};
  EXPECT_EQ(FindEntry(catalogue, Named("anything", "selector")), &catalogue[2]);
  EXPECT_EQ(FindEntry(catalogue, Named("unet_tiny2")), &catalogue[0]);
  EXPECT_EQ(FindEntry(catalogue, Named("unet_wide_3")), &catalogue[1]);
  EXPECT_EQ(FindEntry(catalogue, Named("unet2", "general kind")), &catalogue[0]);
  EXPECT_EQ(FindEntry(catalogue, Named("selectors")), nullptr);
  GoldenCase renamed = Named("other");
  renamed.specs = {{"z", "input", {}}};
  EXPECT_EQ(FindEntry(catalogue, renamed), &catalogue[2]);
}

TEST(CatalogueLookup, TellsKindsOfOneNameApartByTheirTensors) {
  const std::vector<CatalogueEntry> catalogue = {{"rotation", {"x"}, nullptr}, {"rotation", {"y"}, nullptr}};
  for (const std::size_t wanted : {0u, 1u}) {
    for (const char* const kind : {"", "rotation"}) {
      GoldenCase golden_case = Named("rotation_90", kind);
      golden_case.specs = {{catalogue[wanted].signature.front(), "expected", {}}};
      EXPECT_EQ(FindEntry(catalogue, golden_case), &catalogue[wanted]);
    }
  }
}

TEST_F(GoldenFolder, StoredCasesPass) {
  const auto catalogue = Catalogue();
  const auto cases = ReadManifest(folder_);
  EXPECT_GE(cases.size(), 6u);
  for (const GoldenCase& golden_case : cases) {
    const Verdict verdict = Judge(catalogue, golden_case);
    EXPECT_EQ(verdict.outcome, Verdict::Outcome::kPass) << verdict.line;
  }
}

TEST_F(GoldenFolder, AnyChangedExpectationFails) {
  int changed = 0;
  for (const GoldenCase& golden_case : ReadManifest(folder_)) {
    for (const TensorSpec& spec : golden_case.specs) {
      if (spec.role != "expected") continue;
      TensorFile file = SafetensorsReader(golden_case.file).ReadAll();
      const TensorFile original = file;
      HostTensor& tensor = file.tensors.at(spec.name);
      // The top byte holds the sign and most of the exponent, or the sign of an integer.
      tensor.data.back() ^= std::byte{0x40};
      WriteSafetensors(golden_case.file, file);
      const Verdict verdict = Judge(Catalogue(), golden_case);
      EXPECT_EQ(verdict.outcome, Verdict::Outcome::kFail) << spec.name << ": " << verdict.line;
      WriteSafetensors(golden_case.file, original);
      ++changed;
    }
  }
  EXPECT_GE(changed, 20);
}

TEST_F(GoldenFolder, FailsWithAReasonWithoutThrowing) {
  const auto catalogue = Catalogue();
  GoldenCase unknown = Case("metrics");
  unknown.name = "warp_drive";
  unknown.kind = "";
  unknown.specs.clear();
  EXPECT_EQ(Judge(catalogue, unknown).line, "FAIL warp_drive unsupported");

  const GoldenCase without_file = Case("metrics");
  std::filesystem::remove(without_file.file);
  EXPECT_EQ(Judge(catalogue, without_file).outcome, Verdict::Outcome::kFail);

  GoldenCase demanding = Case("geom_lookat");
  demanding.specs.push_back({"R_w", "expected", {{"atol", 1}}});
  EXPECT_NE(Judge(catalogue, demanding).line.find("R_w: is expected but not computed"),
            std::string::npos);
}

TEST_F(GoldenFolder, NothingExpectedIsSkipped) {
  GoldenCase golden_case = Case("metrics");
  std::erase_if(golden_case.specs, [](const TensorSpec& spec) { return spec.role == "expected"; });
  EXPECT_EQ(Judge(Catalogue(), golden_case).outcome, Verdict::Outcome::kSkip);
}

TEST(Manifest, MissingOrForeignFilesAreRefused) { EXPECT_ANY_THROW(ReadManifest("/nonexistent")); }

}  // namespace
}  // namespace antipode::golden
