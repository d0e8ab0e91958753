#include "catalogue.h"

#include <algorithm>
#include <cctype>

#include "geometry_kinds.h"
#ifdef ANTIPODE_NEURAL
#include "gen6d_kinds.h"
#include "loftr_kinds.h"
#include "orientation_kinds.h"
#include "zero123_kinds.h"
#endif

namespace antipode::golden {
namespace {

bool IsVariantOf(const std::string& name, const std::string& kind) {
  if (!name.starts_with(kind)) return false;
  if (name.size() == kind.size()) return true;
  const char next = name[kind.size()];
  return next == '_' || std::isdigit(static_cast<unsigned char>(next));
}

bool HasSignature(const GoldenCase& golden_case, const CatalogueEntry& entry) {
  return !entry.signature.empty() && std::ranges::all_of(entry.signature, [&](const std::string& tensor) {
    return golden_case.Lists(tensor);
  });
}

/// The more special of two entries that both fit by name: the longer kind, and of two with one name that whose tensors
/// the case lists.
bool FitsBetter(const CatalogueEntry& entry, const CatalogueEntry& other, const GoldenCase& golden_case) {
  if (entry.kind.size() != other.kind.size()) return entry.kind.size() > other.kind.size();
  return HasSignature(golden_case, entry) && !HasSignature(golden_case, other);
}

/// By the field `kind`, else by the name without its variant.
const CatalogueEntry* FindByName(std::span<const CatalogueEntry> catalogue, const GoldenCase& golden_case) {
  const CatalogueEntry* by_kind = nullptr;
  const CatalogueEntry* by_name = nullptr;
  for (const CatalogueEntry& entry : catalogue) {
    if (entry.kind == golden_case.kind && (!by_kind || FitsBetter(entry, *by_kind, golden_case))) by_kind = &entry;
    if (IsVariantOf(golden_case.name, entry.kind) && (!by_name || FitsBetter(entry, *by_name, golden_case))) by_name = &entry;
  }
  return by_kind ? by_kind : by_name;
}

const CatalogueEntry* FindBySignature(std::span<const CatalogueEntry> catalogue,
                                      const GoldenCase& golden_case) {
  const CatalogueEntry* only = nullptr;
  for (const CatalogueEntry& entry : catalogue) {
    if (!HasSignature(golden_case, entry)) continue;
    if (only) return nullptr;
    only = &entry;
  }
  return only;
}

}  // namespace

std::vector<CatalogueEntry> Catalogue() {
  std::vector<CatalogueEntry> entries = GeometryKinds();
#ifdef ANTIPODE_NEURAL
  for (CatalogueEntry& entry : Gen6dKinds()) entries.push_back(std::move(entry));
  for (CatalogueEntry& entry : LoftrKinds()) entries.push_back(std::move(entry));
  for (CatalogueEntry& entry : OrientationKinds()) entries.push_back(std::move(entry));
  for (CatalogueEntry& entry : Zero123Kinds()) entries.push_back(std::move(entry));
#endif
  return entries;
}

const CatalogueEntry* FindEntry(std::span<const CatalogueEntry> catalogue,
                                const GoldenCase& golden_case) {
  const CatalogueEntry* by_name = FindByName(catalogue, golden_case);
  return by_name ? by_name : FindBySignature(catalogue, golden_case);
}

}  // namespace antipode::golden
