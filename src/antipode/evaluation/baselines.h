#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "antipode/evaluation/evaluation.h"
#include "antipode/matching/matcher.h"

namespace antipode {

enum class DepthSolver { kPnp, kProcrustes };

/// Correspondences of the whole pictures, lifted by `ObjectPhotograph::depth` (the paper's baselines
/// SIFT + depth + PnP and + Procrustes). Rows of pairs without depth, or without a consistent pose, are failures.
PoseMethod DepthBaseline(std::string name, std::shared_ptr<const Matcher> matcher, DepthSolver solver);

/// Poses that were computed elsewhere. A CSV file with the columns object, reference, query (as in pairs.csv),
/// qw, qx, qy, qz, tx, ty, tz (x_query = R x_reference + t) and, if known, confidence; in any order. Pairs that
/// the file lacks are failures.
/// @throws BadFile naming the line that is malformed, or the columns that are missing
PoseMethod Predictions(const std::filesystem::path& csv);

}  // namespace antipode
