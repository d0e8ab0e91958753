#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "antipode/evaluation/evaluation.h"

namespace antipode {

/// Ends of a 95 % interval, percent.
struct Interval {
  double low = 0;
  double high = 0;
};

/// Accuracy of one kind of error. Percent of pairs with an error strictly below 15 and 30 degrees:
/// mean over the pairs of an object, then over objects.
struct Accuracy {
  double acc15 = 0;  ///< NaN if no error is defined
  double acc30 = 0;
  std::optional<Interval> acc15_interval;  ///< nothing with fewer than two objects
  std::optional<Interval> acc30_interval;
  double median = 0;          ///< degrees, over all pairs
  std::size_t undefined = 0;  ///< pairs left out
};

/// Pairs whose views are `from_deg` <= angle < `to_deg` apart (180 belongs to the last bin);
/// percent of these pairs, all objects together. NaN if there are none.
struct AngleBin {
  double from_deg = 0;
  double to_deg = 0;
  std::size_t pairs = 0;
  Accuracy rotation, translation;  ///< without intervals
};

/// Pairs with a confidence in [from, to); 1 belongs to the last bin.
struct CalibrationBin {
  double from = 0;
  double to = 0;
  std::size_t pairs = 0;
  double mean_confidence = 0;  ///< 0 if there are no pairs
  double share_correct = 0;    ///< rotation error below 30 degrees; 0 if there are no pairs
};

struct Calibration {
  /// sum over bins of (pairs in bin / pairs) |share_correct - mean_confidence|, 0..1
  double expected_error = 0;
  std::vector<CalibrationBin> bins;  ///< 10 of equal width
};

/// Confidence against "correct" of each pair. Confidences are clamped to 0..1.
Calibration Calibrate(std::span<const double> confidences, const std::vector<bool>& correct);

/// 95 % interval of the mean of `values` when objects are drawn anew (percentile bootstrap, 1000
/// resamples, fixed seed). Nothing for fewer than two values.
std::optional<Interval> BootstrapInterval(std::span<const double> values);

struct ObjectRow {
  std::string object;
  bool symmetric = false;
  std::size_t pairs = 0;
  std::size_t failures = 0;
  Accuracy rotation, translation;  ///< without intervals
};

struct EvaluationSummary {
  std::string dataset, method;
  std::size_t pairs = 0;
  std::size_t failures = 0;
  std::map<std::string, std::size_t> failure_messages;  ///< how often each
  Accuracy rotation, translation;
  double seconds_per_pair = 0;                            ///< mean; NaN without pairs
  std::map<std::string, double> stage_seconds_per_pair;  ///< of estimates that succeeded
  std::vector<AngleBin> angle_bins;                       ///< 0, 45, 90, 135, 180 degrees
  std::vector<ObjectRow> objects;
  Calibration calibration;
  double truth_among_likely = 0;  ///< percent of pairs, see EvaluatedPair
  double likely_hypotheses = 0;   ///< mean number a pair
  std::optional<double> swap_consistent;  ///< percent of pairs, swap difference below 1 degree
};

EvaluationSummary Summarize(const EvaluationResult& result);

/// The result without the objects known to be symmetric.
EvaluationResult WithoutSymmetricObjects(const EvaluationResult& result);

}  // namespace antipode
