#include "verdict.h"

#include <cstdio>
#include <exception>
#include <optional>

#include "antipode/util/error.h"
#include "comparison.h"

namespace antipode::golden {
namespace {

struct JudgedTensor {
  std::string name;
  Difference difference;
  Tolerance tolerance;
  double ratio = 0;
};

Verdict Failure(const std::string& name, const std::string& reason) {
  return {Verdict::Outcome::kFail, "FAIL " + name + " " + reason};
}

bool IsCompared(const TensorSpec& spec, const NumericTensors& result) {
  return spec.role == "expected" || (spec.role == "intermediate" && result.contains(spec.name));
}

JudgedTensor JudgeTensor(const TensorSpec& spec, const GoldenCase& golden_case,
                         const NumericTensors& result) {
  const auto found = result.find(spec.name);
  if (found == result.end()) throw Error(spec.name, "is expected but not computed");
  JudgedTensor judged{spec.name, Compare(found->second, golden_case.Stored(spec.name)),
                      ToleranceOf(spec)};
  judged.ratio = judged.difference.RatioTo(judged.tolerance);
  return judged;
}

std::optional<JudgedTensor> WorstTensor(const GoldenCase& golden_case,
                                        const NumericTensors& result) {
  std::optional<JudgedTensor> worst;
  for (const TensorSpec& spec : golden_case.specs) {
    if (!IsCompared(spec, result)) continue;
    JudgedTensor judged = JudgeTensor(spec, golden_case, result);
    if (!worst || judged.ratio > worst->ratio) worst = std::move(judged);
  }
  return worst;
}

std::string Scientific(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

Verdict VerdictOf(const std::string& name, const JudgedTensor& worst) {
  const std::string figures = name + " " + Scientific(worst.difference.max_abs) + " " +
                              Scientific(worst.difference.rel_l2) + " " +
                              Scientific(worst.tolerance.Main()) + " " + worst.name;
  if (worst.ratio <= 1) return {Verdict::Outcome::kPass, "PASS " + figures};
  return {Verdict::Outcome::kFail, "FAIL " + figures + " " + worst.tolerance.Text()};
}

Verdict JudgeUnguarded(const CatalogueEntry& entry, const GoldenCase& golden_case) {
  const GoldenCase loaded = LoadTensors(golden_case);
  const std::optional<JudgedTensor> worst = WorstTensor(loaded, entry.computation(loaded));
  if (!worst) return {Verdict::Outcome::kSkip, "SKIP " + golden_case.name + " nothing expected"};
  return VerdictOf(golden_case.name, *worst);
}

}  // namespace

Verdict Judge(std::span<const CatalogueEntry> catalogue, const GoldenCase& golden_case) {
  const CatalogueEntry* entry = FindEntry(catalogue, golden_case);
  if (!entry) return Failure(golden_case.name, "unsupported");
  try {
    return JudgeUnguarded(*entry, golden_case);
  } catch (const std::exception& error) {
    return Failure(golden_case.name, error.what());
  }
}

}  // namespace antipode::golden
