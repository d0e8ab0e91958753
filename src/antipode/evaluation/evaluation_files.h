#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "antipode/evaluation/evaluation.h"
#include "antipode/evaluation/evaluation_summary.h"

namespace antipode {

/// Writes into `folder`, each file atomically:
///   pairs.csv     one row a pair, header first; angles in degrees; an undefined value is empty
///   summary.json  see SummaryJson, and the same of the objects that are not symmetric under
///                 "without_symmetric" if some, but not all, are
///   table.md      see SummaryTable
/// @throws Error naming the file that cannot be written
void WriteEvaluation(const EvaluationResult& result, const std::filesystem::path& folder);

/// One row a method: accuracy of rotation and translation, failures, calibration error, seconds.
std::string ComparisonTable(std::span<const EvaluationSummary> summaries);

/// Columns: object, reference, query, angle_deg (between the views, from the object's centre),
/// rotation_error_deg, translation_error_deg, confidence, seconds, rotation_deg (of the true
/// rotation), failed (0 or 1), likely_hypotheses, truth_among_likely (0 or 1), swap_difference_deg,
/// matching_error_deg, then one of every name in `EvaluatedPair::evidence`.
std::string PairsCsv(const EvaluationResult& result);

/// {"pairs": N, "rotation": {"acc15", "acc30", "median", "acc15_interval": [low, high], ..},
///  "translation": {..}, "seconds_per_pair", ..}; percentages 0..100, degrees, seconds; null where
/// there is nothing to average.
std::string SummaryJson(const EvaluationSummary& summary);

/// Markdown: totals, by angle, by object, calibration.
std::string SummaryTable(const EvaluationSummary& summary);

}  // namespace antipode
