#pragma once

#include <span>
#include <string>
#include <vector>

#include "manifest.h"
#include "numeric_tensor.h"

namespace antipode::golden {

/// Computes the tensors of a case from its stored inputs and its configuration.
using Computation = NumericTensors (*)(const GoldenCase&);

struct CatalogueEntry {
  std::string kind;                    ///< also the case name without its variant
  std::vector<std::string> signature;  ///< tensors that only cases of this kind list; may be empty
  Computation computation;
};

/// Everything this program can compute.
std::vector<CatalogueEntry> Catalogue();

/// The entry for a case: the one whose kind is the case's kind; else the longest kind that the case
/// name begins with, followed by nothing, '_' or a digit; else the only one whose signature the
/// case lists. Null if there is none.
const CatalogueEntry* FindEntry(std::span<const CatalogueEntry> catalogue,
                                const GoldenCase& golden_case);

}  // namespace antipode::golden
