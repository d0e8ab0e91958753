#include "antipode/evaluation/evaluation_files.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <locale>
#include <map>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "antipode/util/files.h"
#include "antipode/util/version.h"

namespace antipode {
namespace {

using Json = nlohmann::ordered_json;

std::string Number(double value, int digits = 6) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << std::fixed << std::setprecision(digits) << value;
  return text.str();
}

std::string Number(const std::optional<double>& value) { return value ? Number(*value) : ""; }

std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// Names of all that speaks for the poses of some pair.
std::set<std::string> EvidenceOf(const EvaluationResult& result) {
  std::set<std::string> names;
  for (const EvaluatedObject& object : result.objects)
    for (const EvaluatedPair& pair : object.pairs)
      for (const auto& [name, value] : pair.evidence) names.insert(name);
  return names;
}

std::string CsvRow(const EvaluatedPair& pair, const std::set<std::string>& evidence) {
  std::vector<std::string> fields{CsvField(pair.object),
                                        CsvField(pair.reference),
                                        CsvField(pair.query),
                                        Number(pair.angle_deg),
                                        Number(pair.rotation_error_deg),
                                        Number(pair.translation_error_deg),
                                        Number(pair.confidence),
                                        Number(pair.seconds),
                                        Number(pair.rotation_deg),
                                        pair.failed ? "1" : "0",
                                        std::to_string(pair.likely_hypotheses),
                                        pair.truth_among_likely ? "1" : "0",
                                        Number(pair.swap_difference_deg),
                                        Number(pair.matching_error_deg)};
  for (const std::string& name : evidence) {
    const auto value = pair.evidence.find(name);
    fields.push_back(value == pair.evidence.end() ? "" : Number(value->second));
  }
  std::string row;
  for (const std::string& field : fields) row += (&field == fields.data() ? "" : ",") + field;
  return row + "\n";
}

void AddInterval(const char* key, const std::optional<Interval>& interval, Json& json) {
  if (interval) json[key] = {interval->low, interval->high};
}

Json ToJson(const Accuracy& accuracy) {
  Json json{{"acc15", accuracy.acc15}, {"acc30", accuracy.acc30}, {"median", accuracy.median}};
  AddInterval("acc15_interval", accuracy.acc15_interval, json);
  AddInterval("acc30_interval", accuracy.acc30_interval, json);
  json["undefined"] = accuracy.undefined;
  return json;
}

Json ToJson(const std::vector<AngleBin>& bins) {
  Json json = Json::array();
  for (const AngleBin& bin : bins) {
    json.push_back({{"from_deg", bin.from_deg},
                    {"to_deg", bin.to_deg},
                    {"pairs", bin.pairs},
                    {"rotation", ToJson(bin.rotation)},
                    {"translation", ToJson(bin.translation)}});
  }
  return json;
}

Json ToJson(const std::vector<ObjectRow>& objects) {
  Json json = Json::array();
  for (const ObjectRow& object : objects) {
    json.push_back({{"object", object.object},
                    {"symmetric", object.symmetric},
                    {"pairs", object.pairs},
                    {"failures", object.failures},
                    {"rotation", ToJson(object.rotation)},
                    {"translation", ToJson(object.translation)}});
  }
  return json;
}

Json ToJson(const Calibration& calibration) {
  Json bins = Json::array();
  for (const CalibrationBin& bin : calibration.bins) {
    bins.push_back({{"from", bin.from},
                    {"to", bin.to},
                    {"pairs", bin.pairs},
                    {"mean_confidence", bin.mean_confidence},
                    {"share_correct", bin.share_correct}});
  }
  return {{"expected_calibration_error", calibration.expected_error},
          {"correct_below_deg", 30},
          {"bins", std::move(bins)}};
}

Json ToJson(const EvaluationSummary& summary) {
  Json json{{"antipode", Version()},
            {"dataset", summary.dataset},
            {"method", summary.method},
            {"pairs", summary.pairs},
            {"failures", summary.failures},
            {"rotation", ToJson(summary.rotation)},
            {"translation", ToJson(summary.translation)},
            {"seconds_per_pair", summary.seconds_per_pair},
            {"stage_seconds_per_pair", summary.stage_seconds_per_pair},
            {"hypotheses",
             {{"truth_among_likely", summary.truth_among_likely},
              {"likely_per_pair", summary.likely_hypotheses},
              {"least_probability", 0.1}}},
            {"calibration", ToJson(summary.calibration)},
            {"by_angle", ToJson(summary.angle_bins)},
            {"by_object", ToJson(summary.objects)},
            {"failure_messages", summary.failure_messages}};
  if (summary.swap_consistent) json["swap_consistent"] = *summary.swap_consistent;
  return json;
}

std::string Dump(const Json& json) {
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

/// "-" where there is nothing to average.
std::string Cell(double value, int digits = 1) {
  return std::isfinite(value) ? Number(value, digits) : "-";
}

std::string CellWithInterval(double value, const std::optional<Interval>& interval) {
  if (!interval) return Cell(value);
  return Cell(value) + " [" + Cell(interval->low) + ", " + Cell(interval->high) + "]";
}

std::string Row(const std::vector<std::string>& cells) {
  std::string row = "|";
  for (const std::string& cell : cells) row += " " + cell + " |";
  return row + "\n";
}

std::string Header(const std::vector<std::string>& titles) {
  std::string rule = "|";
  for (std::size_t i = 0; i < titles.size(); ++i) rule += i == 0 ? " --- |" : " ---: |";
  return Row(titles) + rule + "\n";
}

/// A name cannot end its cell or line.
std::string NameCell(std::string name) {
  std::replace(name.begin(), name.end(), '|', '/');
  std::replace(name.begin(), name.end(), '\n', ' ');
  return name;
}

std::string AccuracyRow(const std::string& name, const Accuracy& accuracy) {
  return Row({name, CellWithInterval(accuracy.acc15, accuracy.acc15_interval),
              CellWithInterval(accuracy.acc30, accuracy.acc30_interval), Cell(accuracy.median),
              std::to_string(accuracy.undefined)});
}

std::string TotalsTable(const EvaluationSummary& summary) {
  return Header({"", "within 15 deg, %", "within 30 deg, %", "median, deg", "undefined"}) +
         AccuracyRow("rotation", summary.rotation) +
         AccuracyRow("translation direction", summary.translation);
}

std::vector<std::string> BreakdownCells(const Accuracy& rotation, const Accuracy& translation) {
  return {Cell(rotation.acc15), Cell(rotation.acc30), Cell(translation.acc15),
          Cell(translation.acc30), Cell(rotation.median)};
}

std::string BreakdownHeader(const std::string& title) {
  return Header({title, "pairs", "R@15", "R@30", "t@15", "t@30", "median R"});
}

std::string BreakdownRow(const std::string& name, std::size_t pairs, const Accuracy& rotation,
                         const Accuracy& translation) {
  std::vector<std::string> cells{name, std::to_string(pairs)};
  for (std::string& cell : BreakdownCells(rotation, translation)) cells.push_back(std::move(cell));
  return Row(cells);
}

std::string AngleTable(const EvaluationSummary& summary) {
  std::string table = BreakdownHeader("between views, deg");
  for (const AngleBin& bin : summary.angle_bins) {
    table += BreakdownRow(Cell(bin.from_deg, 0) + "-" + Cell(bin.to_deg, 0), bin.pairs,
                          bin.rotation, bin.translation);
  }
  return table;
}

std::string ObjectTable(const EvaluationSummary& summary) {
  std::string table = BreakdownHeader("object");
  for (const ObjectRow& object : summary.objects) {
    table += BreakdownRow(NameCell(object.object) + (object.symmetric ? " (symmetric)" : ""),
                          object.pairs, object.rotation, object.translation);
  }
  return table;
}

std::string CalibrationTable(const EvaluationSummary& summary) {
  std::string table = Header({"confidence", "pairs", "mean confidence", "share correct"});
  for (const CalibrationBin& bin : summary.calibration.bins) {
    const bool empty = bin.pairs == 0;
    table += Row({Cell(bin.from) + "-" + Cell(bin.to), std::to_string(bin.pairs),
                  empty ? "-" : Cell(bin.mean_confidence, 3),
                  empty ? "-" : Cell(bin.share_correct, 3)});
  }
  return table;
}

/// " (crop 0.002, encode 0.050)", or nothing.
std::string StageList(const std::map<std::string, double>& seconds) {
  std::string list;
  for (const auto& [stage, mean] : seconds)
    list += (list.empty() ? " (" : ", ") + NameCell(stage) + " " + Cell(mean, 3);
  return list.empty() ? list : list + ")";
}

std::string FactsList(const EvaluationSummary& summary) {
  std::string list = "- pairs: " + std::to_string(summary.pairs) +
                     ", failures: " + std::to_string(summary.failures) + "\n";
  list += "- seconds a pair: " + Cell(summary.seconds_per_pair, 3) +
          StageList(summary.stage_seconds_per_pair) + "\n";
  list += "- a hypothesis of probability 0.1 or more is within 30 degrees of the truth: " +
          Cell(summary.truth_among_likely) + " % of pairs (" + Cell(summary.likely_hypotheses, 2) +
          " such hypotheses a pair)\n";
  if (summary.swap_consistent) {
    list += "- swapped pairs give the inverse rotation within 1 degree: " +
            Cell(*summary.swap_consistent) + " %\n";
  }
  return list;
}

bool SomeButNotAllSymmetric(const EvaluationResult& result) {
  const auto symmetric =
      std::count_if(result.objects.begin(), result.objects.end(),
                    [](const EvaluatedObject& object) { return object.symmetric; });
  return symmetric > 0 && static_cast<std::size_t>(symmetric) < result.objects.size();
}

}  // namespace

std::string PairsCsv(const EvaluationResult& result) {
  std::string csv =
      "object,reference,query,angle_deg,rotation_error_deg,translation_error_deg,confidence,"
      "seconds,rotation_deg,failed,likely_hypotheses,truth_among_likely,swap_difference_deg,"
      "matching_error_deg";
  const std::set<std::string> evidence = EvidenceOf(result);
  for (const std::string& name : evidence) csv += "," + name;
  csv += "\n";
  for (const EvaluatedObject& object : result.objects)
    for (const EvaluatedPair& pair : object.pairs) csv += CsvRow(pair, evidence);
  return csv;
}

std::string SummaryJson(const EvaluationSummary& summary) { return Dump(ToJson(summary)); }

std::string SummaryTable(const EvaluationSummary& summary) {
  return "# " + NameCell(summary.method) + " on " + NameCell(summary.dataset) + "\n\n" +
         FactsList(summary) + "\n" + TotalsTable(summary) +
         "\nPercent of pairs, mean over objects, [95 % interval over objects].\n\n" +
         AngleTable(summary) + "\n" + ObjectTable(summary) +
         "\nConfidence against rotation errors below 30 degrees; expected calibration error " +
         Cell(summary.calibration.expected_error, 3) + ".\n\n" + CalibrationTable(summary);
}

std::string ComparisonTable(std::span<const EvaluationSummary> summaries) {
  std::string table = Header({"method", "R@15", "R@30", "t@15", "t@30", "median R", "failures", "calibration error", "seconds a pair"});
  for (const EvaluationSummary& summary : summaries) {
    std::vector<std::string> cells{NameCell(summary.method)};
    for (std::string& cell : BreakdownCells(summary.rotation, summary.translation)) cells.push_back(std::move(cell));
    cells.push_back(std::to_string(summary.failures));
    cells.push_back(Cell(summary.calibration.expected_error, 3));
    cells.push_back(Cell(summary.seconds_per_pair, 3));
    table += Row(cells);
  }
  return table;
}

void WriteEvaluation(const EvaluationResult& result, const std::filesystem::path& folder) {
  const EvaluationSummary summary = Summarize(result);
  Json json = ToJson(summary);
  json["loading_seconds"] = result.loading_seconds;
  std::string table = SummaryTable(summary);
  if (SomeButNotAllSymmetric(result)) {
    const EvaluationSummary rest = Summarize(WithoutSymmetricObjects(result));
    json["without_symmetric"] = ToJson(rest);
    table += "\n# Without symmetric objects\n\n" + FactsList(rest) + "\n" + TotalsTable(rest);
  }
  WriteFileAtomically(folder / "pairs.csv", PairsCsv(result));
  WriteFileAtomically(folder / "summary.json", Dump(json));
  WriteFileAtomically(folder / "table.md", table);
}

}  // namespace antipode
