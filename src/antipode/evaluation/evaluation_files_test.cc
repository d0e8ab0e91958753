#include "antipode/evaluation/evaluation_files.h"

#include <algorithm>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "antipode/util/files.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

EvaluationResult SmallResult() {
  EvaluatedPair good;
  good.object = "cup, \"blue\"";
  good.reference = "0";
  good.query = "1";
  good.angle_deg = 100;
  good.rotation_error_deg = 3.5;
  good.translation_error_deg = 4.25;
  good.confidence = 0.75;
  good.seconds = 0.125;
  EvaluatedPair failed = good;
  failed.object = "can|\xff";
  failed.rotation_error_deg = 180;
  failed.translation_error_deg.reset();
  failed.confidence = 0;
  failed.failed = true;
  failed.failure = "mask: is empty; give another";
  return {"objects", "test", {{good.object, false, {good}, {{"encode", 0.1}}},
                              {failed.object, true, {failed}, {}}}, 0};
}

/// Fields of CSV text by RFC 4180.
std::vector<std::vector<std::string>> ParseCsv(const std::string& text) {
  std::vector<std::vector<std::string>> rows(1, {""});
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted && c == '"' && text[i + 1] == '"') {
      rows.back().back() += text[i++];
    } else if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      rows.back().emplace_back();
    } else if (c == '\n' && !quoted) {
      rows.push_back({""});
    } else {
      rows.back().back() += c;
    }
  }
  rows.pop_back();
  return rows;
}

TEST(PairsCsv, HasOneRowAPairUnderTheHeader) {
  const auto rows = ParseCsv(PairsCsv(SmallResult()));
  ASSERT_EQ(rows.size(), 3u);
  for (const auto& row : rows) EXPECT_EQ(row.size(), rows[0].size());
  const std::vector<std::string> first(rows[0].begin(), rows[0].begin() + 8);
  EXPECT_EQ(first, (std::vector<std::string>{"object", "reference", "query", "angle_deg",
                                             "rotation_error_deg", "translation_error_deg",
                                             "confidence", "seconds"}));
  EXPECT_EQ(rows[1][0], "cup, \"blue\"");
  EXPECT_EQ(std::stod(rows[1][4]), 3.5);
  EXPECT_EQ(std::stod(rows[1][5]), 4.25);
  EXPECT_EQ(std::stod(rows[1][7]), 0.125);
  EXPECT_EQ(rows[2][5], "");
  EXPECT_EQ(std::stod(rows[2][4]), 180);
  EXPECT_EQ(rows[2][9], "1");
  EXPECT_EQ(rows[1].back(), "");
}

TEST(SummaryJson, HoldsTheContractsKeys) {
  const auto json = nlohmann::json::parse(SummaryJson(Summarize(SmallResult())));
  EXPECT_EQ(json.at("pairs"), 2);
  EXPECT_EQ(json.at("failures"), 1);
  EXPECT_EQ(json.at("rotation").at("acc15"), 50);
  EXPECT_EQ(json.at("rotation").at("acc30"), 50);
  EXPECT_EQ(json.at("rotation").at("median"), (3.5 + 180) / 2);
  EXPECT_EQ(json.at("rotation").at("acc15_interval").size(), 2u);
  EXPECT_EQ(json.at("translation").at("acc15"), 100);
  EXPECT_EQ(json.at("translation").at("undefined"), 1);
  EXPECT_EQ(json.at("seconds_per_pair"), 0.125);
  EXPECT_EQ(json.at("by_angle").size(), 4u);
  EXPECT_EQ(json.at("by_object").size(), 2u);
  EXPECT_EQ(json.at("calibration").at("bins").size(), 10u);
  EXPECT_EQ(json.at("failure_messages").at("mask: is empty; give another"), 1);
  EXPECT_FALSE(json.contains("swap_consistent"));
}

TEST(SummaryJson, SaysNullWhereThereIsNothing) {
  const auto json = nlohmann::json::parse(SummaryJson(Summarize({"objects", "test", {}, 0})));
  EXPECT_EQ(json.at("pairs"), 0);
  EXPECT_TRUE(json.at("rotation").at("acc15").is_null());
  EXPECT_TRUE(json.at("seconds_per_pair").is_null());
}

TEST(SummaryTable, EveryTableIsRectangular) {
  std::istringstream table(SummaryTable(Summarize(SmallResult())));
  std::ptrdiff_t columns = 0;
  int rows = 0;
  for (std::string line; std::getline(table, line);) {
    const auto bars = std::count(line.begin(), line.end(), '|');
    if (columns > 0 && bars > 0) {
      EXPECT_EQ(bars, columns) << line;
    }
    columns = bars;
    rows += bars > 0;
    EXPECT_EQ(line.find("nan"), std::string::npos) << line;
  }
  EXPECT_EQ(rows, 2 + 2 + 2 + 4 + 2 + 2 + 2 + 10);
}

TEST(SummaryTable, ListsTheStages) {
  const std::string table = SummaryTable(Summarize(SmallResult()));
  EXPECT_NE(table.find("seconds a pair: 0.125 (encode 0.100)"), std::string::npos) << table;
}

TEST(WriteEvaluation, WritesThreeFilesIntoANewFolder) {
  const TemporaryFolder temporary;
  const auto folder = temporary.path() / "a" / "b";
  WriteEvaluation(SmallResult(), folder);
  EXPECT_EQ(ParseCsv(ReadFile(folder / "pairs.csv")).size(), 3u);
  EXPECT_NE(ReadFile(folder / "table.md").find("rotation"), std::string::npos);
  const auto json = nlohmann::json::parse(ReadFile(folder / "summary.json"));
  EXPECT_EQ(json.at("rotation").at("acc15"), 50);
  EXPECT_EQ(json.at("without_symmetric").at("rotation").at("acc15"), 100);
  EXPECT_EQ(json.at("without_symmetric").at("pairs"), 1);
}

TEST(WriteEvaluation, HasNoSecondSummaryWithoutSymmetricObjects) {
  const TemporaryFolder temporary;
  EvaluationResult result = SmallResult();
  result.objects.pop_back();
  WriteEvaluation(result, temporary.path());
  const auto json = nlohmann::json::parse(ReadFile(temporary.path() / "summary.json"));
  EXPECT_FALSE(json.contains("without_symmetric"));
}

}  // namespace
}  // namespace antipode
