#include "antipode/evaluation/evaluation_summary.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "antipode/geometry/pose_metrics.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

constexpr std::array kThresholdsDeg = {15.0, 30.0};
constexpr double kCorrectDeg = 30;
constexpr double kConsistentDeg = 1;
constexpr std::array kAngleEdgesDeg = {0.0, 45.0, 90.0, 135.0, 180.0};
constexpr int kCalibrationBins = 10;
constexpr int kResamples = 1000;
constexpr std::size_t kTail = 25;  // 2.5 % of the resamples
constexpr std::uint64_t kBootstrapSeed = 1;
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

enum class ErrorKind { kRotation, kTranslation };

std::optional<double> ErrorOf(const EvaluatedPair& pair, ErrorKind kind) {
  return kind == ErrorKind::kRotation ? pair.rotation_error_deg : pair.translation_error_deg;
}

ErrorSummary SummarizeKind(std::span<const EvaluatedObject> objects, ErrorKind kind) {
  std::vector<ObjectErrors> errors;
  for (const EvaluatedObject& object : objects) {
    errors.push_back({object.object, {}});
    for (const EvaluatedPair& pair : object.pairs)
      errors.back().errors.push_back(ErrorOf(pair, kind));
  }
  return SummarizeErrors(errors, kThresholdsDeg);
}

Accuracy AccuracyOf(std::span<const EvaluatedObject> objects, ErrorKind kind) {
  const ErrorSummary summary = SummarizeKind(objects, kind);
  Accuracy accuracy;
  accuracy.acc15 = 100 * summary.accuracy[0];
  accuracy.acc30 = 100 * summary.accuracy[1];
  accuracy.median = summary.median;
  accuracy.undefined = summary.undefined;
  return accuracy;
}

Accuracy AccuracyOf(const EvaluatedObject& object, ErrorKind kind) {
  return AccuracyOf(std::span(&object, 1), kind);
}

void AddIntervals(std::span<const ObjectRow> objects, Accuracy ObjectRow::*kind,
                  Accuracy& accuracy) {
  std::vector<double> acc15, acc30;
  for (const ObjectRow& object : objects) {
    const Accuracy& one = object.*kind;
    if (std::isnan(one.acc15)) continue;
    acc15.push_back(one.acc15);
    acc30.push_back(one.acc30);
  }
  accuracy.acc15_interval = BootstrapInterval(acc15);
  accuracy.acc30_interval = BootstrapInterval(acc30);
}

std::vector<EvaluatedPair> AllPairs(const EvaluationResult& result) {
  std::vector<EvaluatedPair> pairs;
  for (const EvaluatedObject& object : result.objects)
    pairs.insert(pairs.end(), object.pairs.begin(), object.pairs.end());
  return pairs;
}

double MeanOver(std::span<const EvaluatedPair> pairs,
                const std::function<double(const EvaluatedPair&)>& value) {
  if (pairs.empty()) return kNothing;
  double sum = 0;
  for (const EvaluatedPair& pair : pairs) sum += value(pair);
  return sum / static_cast<double>(pairs.size());
}

std::vector<AngleBin> BinByAngle(std::span<const EvaluatedPair> pairs) {
  std::vector<AngleBin> bins;
  for (std::size_t i = 0; i + 1 < kAngleEdgesDeg.size(); ++i) {
    AngleBin bin;
    bin.from_deg = kAngleEdgesDeg[i];
    bin.to_deg = kAngleEdgesDeg[i + 1];
    const bool last = i + 2 == kAngleEdgesDeg.size();
    EvaluatedObject inside;
    for (const EvaluatedPair& pair : pairs) {
      if (pair.angle_deg >= bin.from_deg && (last || pair.angle_deg < bin.to_deg))
        inside.pairs.push_back(pair);
    }
    bin.pairs = inside.pairs.size();
    bin.rotation = AccuracyOf(inside, ErrorKind::kRotation);
    bin.translation = AccuracyOf(inside, ErrorKind::kTranslation);
    bins.push_back(bin);
  }
  return bins;
}

std::size_t CountFailures(std::span<const EvaluatedPair> pairs) {
  return std::count_if(pairs.begin(), pairs.end(),
                       [](const EvaluatedPair& pair) { return pair.failed; });
}

ObjectRow RowOf(const EvaluatedObject& object) {
  ObjectRow row;
  row.object = object.object;
  row.symmetric = object.symmetric;
  row.pairs = object.pairs.size();
  row.failures = CountFailures(object.pairs);
  row.rotation = AccuracyOf(object, ErrorKind::kRotation);
  row.translation = AccuracyOf(object, ErrorKind::kTranslation);
  return row;
}

Calibration CalibrationOf(std::span<const EvaluatedPair> pairs) {
  std::vector<double> confidences;
  std::vector<bool> correct;
  for (const EvaluatedPair& pair : pairs) {
    confidences.push_back(pair.confidence);
    correct.push_back(pair.rotation_error_deg < kCorrectDeg);
  }
  return Calibrate(confidences, correct);
}

std::map<std::string, double> MeanStageSeconds(std::span<const EvaluatedObject> objects) {
  std::map<std::string, double> mean;
  std::size_t estimates = 0;
  for (const EvaluatedObject& object : objects) {
    estimates += object.pairs.size() - CountFailures(object.pairs);
    for (const auto& [stage, seconds] : object.stage_seconds) mean[stage] += seconds;
  }
  for (auto& [stage, seconds] : mean) seconds /= static_cast<double>(estimates);
  return mean;
}

std::optional<double> SwapConsistency(std::span<const EvaluatedPair> pairs) {
  std::vector<double> differences;
  for (const EvaluatedPair& pair : pairs)
    if (pair.swap_difference_deg) differences.push_back(*pair.swap_difference_deg);
  if (differences.empty()) return std::nullopt;
  return 100 * FractionBelow(differences, kConsistentDeg);
}

}  // namespace

Calibration Calibrate(std::span<const double> confidences, const std::vector<bool>& correct) {
  if (confidences.size() != correct.size())
    throw Error("calibration", "needs one answer for each confidence");
  Calibration calibration;
  for (int i = 0; i < kCalibrationBins; ++i) {
    CalibrationBin bin;
    bin.from = static_cast<double>(i) / kCalibrationBins;
    bin.to = static_cast<double>(i + 1) / kCalibrationBins;
    calibration.bins.push_back(bin);
  }
  for (std::size_t i = 0; i < confidences.size(); ++i) {
    const double confidence = std::clamp(confidences[i], 0.0, 1.0);
    const int index =
        std::min(static_cast<int>(confidence * kCalibrationBins), kCalibrationBins - 1);
    CalibrationBin& bin = calibration.bins[index];
    ++bin.pairs;
    bin.mean_confidence += confidence;
    bin.share_correct += correct[i];
  }
  for (CalibrationBin& bin : calibration.bins) {
    if (bin.pairs == 0) continue;
    const auto pairs = static_cast<double>(bin.pairs);
    bin.mean_confidence /= pairs;
    bin.share_correct /= pairs;
    calibration.expected_error += pairs / static_cast<double>(confidences.size()) *
                                  std::abs(bin.share_correct - bin.mean_confidence);
  }
  return calibration;
}

std::optional<Interval> BootstrapInterval(std::span<const double> values) {
  if (values.size() < 2) return std::nullopt;
  std::mt19937_64 random(kBootstrapSeed);
  std::vector<double> means;
  for (int i = 0; i < kResamples; ++i) {
    double sum = 0;
    for (std::size_t drawn = 0; drawn < values.size(); ++drawn)
      sum += values[UniformIndex(random, values.size())];
    means.push_back(sum / static_cast<double>(values.size()));
  }
  std::sort(means.begin(), means.end());
  return Interval{means[kTail], means[kResamples - 1 - kTail]};
}

EvaluationSummary Summarize(const EvaluationResult& result) {
  const std::vector<EvaluatedPair> pairs = AllPairs(result);
  EvaluationSummary summary;
  summary.dataset = result.dataset;
  summary.method = result.method;
  summary.pairs = pairs.size();
  summary.failures = CountFailures(pairs);
  for (const EvaluatedPair& pair : pairs)
    if (pair.failed) ++summary.failure_messages[pair.failure];

  for (const EvaluatedObject& object : result.objects) summary.objects.push_back(RowOf(object));
  summary.rotation = AccuracyOf(result.objects, ErrorKind::kRotation);
  summary.translation = AccuracyOf(result.objects, ErrorKind::kTranslation);
  AddIntervals(summary.objects, &ObjectRow::rotation, summary.rotation);
  AddIntervals(summary.objects, &ObjectRow::translation, summary.translation);

  summary.seconds_per_pair =
      MeanOver(pairs, [](const EvaluatedPair& pair) { return pair.seconds; });
  summary.stage_seconds_per_pair = MeanStageSeconds(result.objects);
  summary.angle_bins = BinByAngle(pairs);
  summary.calibration = CalibrationOf(pairs);
  summary.truth_among_likely =
      100 * MeanOver(pairs, [](const EvaluatedPair& pair) { return pair.truth_among_likely; });
  summary.likely_hypotheses =
      MeanOver(pairs, [](const EvaluatedPair& pair) { return pair.likely_hypotheses; });
  summary.swap_consistent = SwapConsistency(pairs);
  return summary;
}

EvaluationResult WithoutSymmetricObjects(const EvaluationResult& result) {
  EvaluationResult remaining = result;
  std::erase_if(remaining.objects, [](const EvaluatedObject& object) { return object.symmetric; });
  return remaining;
}

}  // namespace antipode
