#pragma once

#include <span>
#include <string>

#include "catalogue.h"
#include "manifest.h"

namespace antipode::golden {

/// The outcome of one case.
struct Verdict {
  enum class Outcome { kPass, kFail, kSkip };
  Outcome outcome = Outcome::kFail;
  /// "PASS|FAIL|SKIP name max_abs rel_l2 tolerance tensor" of the tensor nearest to or farthest
  /// beyond its tolerance (0 means exact), all its limits if it failed; or "FAIL name reason".
  std::string line;
};

/// Computes the case and compares every expected tensor, and the intermediate ones that the
/// computation gives. Never throws: whatever goes wrong is a failure with its reason in the line. A
/// case that expects nothing is skipped.
Verdict Judge(std::span<const CatalogueEntry> catalogue, const GoldenCase& golden_case);

}  // namespace antipode::golden
