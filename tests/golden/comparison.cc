#include "comparison.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "antipode/util/error.h"

namespace antipode::golden {
namespace {

using nlohmann::json;

constexpr double kUnlimited = std::numeric_limits<double>::infinity();
constexpr std::string_view kGreyLevelsPrefix = "8-bit image: max ";

Tolerance ToleranceOfText(const TensorSpec& spec, const std::string& text) {
  if (text == "exact") return {.max_abs = 0};
  if (text.starts_with(kGreyLevelsPrefix)) {
    return {.max_abs = std::stod(text.substr(kGreyLevelsPrefix.size()))};
  }
  throw Error(spec.name, "has an unknown tolerance '" + text + "'");
}

Tolerance ToleranceOfObject(const TensorSpec& spec, const json& limits) {
  const std::string kind = limits.at("kind");
  if (kind == "exact") return {.max_abs = 0};
  if (kind == "float") return {.max_abs = limits.at("max_abs"), .rel_l2 = limits.at("rel_l2")};
  if (kind == "grey_levels") {
    return {.max_abs = limits.at("max_abs"),
            .max_fraction_different = limits.at("max_fraction_different")};
  }
  throw Error(spec.name, "has an unknown kind of tolerance '" + kind + "'");
}

double AbsoluteDifference(double a, double b) {
  if (a == b || (std::isnan(a) && std::isnan(b))) return 0;
  const double difference = std::abs(a - b);
  return std::isnan(difference) ? kUnlimited : difference;
}

double Ratio(double difference, double limit) {
  if (difference == 0 || limit == kUnlimited) return 0;
  return limit == 0 ? kUnlimited : difference / limit;
}

std::string Limit(const char* name, double value) {
  char text[64];
  std::snprintf(text, sizeof text, "%s<=%g", name, value);
  return text;
}

}  // namespace

double Tolerance::Main() const { return max_abs != kUnlimited ? max_abs : mean_abs; }

std::string Tolerance::Text() const {
  if (max_abs == 0) return "exact";
  std::string text;
  const auto append = [&](const std::string& limit) { text += (text.empty() ? "" : ",") + limit; };
  if (max_abs != kUnlimited) append(Limit("max_abs", max_abs));
  if (rel_l2 != kUnlimited) append(Limit("rel_l2", rel_l2));
  if (mean_abs != kUnlimited) append(Limit("mean_abs", mean_abs));
  if (max_fraction_different < 1) append(Limit("different", max_fraction_different));
  return text;
}

Tolerance ToleranceOf(const TensorSpec& spec) {
  const json& attributes = spec.attributes;
  if (attributes.contains("tolerance")) {
    const json& tolerance = attributes.at("tolerance");
    return tolerance.is_string() ? ToleranceOfText(spec, tolerance)
                                 : ToleranceOfObject(spec, tolerance);
  }
  if (!attributes.contains("atol")) throw Error(spec.name, "has no tolerance in the manifest");
  const bool is_picture = attributes.value("dtype", "") == "U8";
  if (is_picture) return {.mean_abs = attributes.at("atol")};
  return {.max_abs = attributes.at("atol")};
}

double Difference::RatioTo(const Tolerance& tolerance) const {
  return std::max({Ratio(max_abs, tolerance.max_abs), Ratio(rel_l2, tolerance.rel_l2),
                   Ratio(mean_abs, tolerance.mean_abs),
                   Ratio(fraction_different, tolerance.max_fraction_different),
                   max_abs == kUnlimited ? kUnlimited : 0});
}

Difference Compare(const NumericTensor& result, const NumericTensor& expected) {
  if (result.shape != expected.shape || result.values.size() != expected.values.size()) {
    return {kUnlimited, kUnlimited, kUnlimited, 1};
  }
  if (expected.values.empty()) return {};
  Difference difference;
  double sum = 0, squared_difference = 0, squared_expected = 0;
  std::size_t different = 0;
  for (std::size_t i = 0; i < expected.values.size(); ++i) {
    const double absolute = AbsoluteDifference(result.values[i], expected.values[i]);
    difference.max_abs = std::max(difference.max_abs, absolute);
    sum += absolute;
    squared_difference += absolute * absolute;
    if (std::isfinite(expected.values[i]))
      squared_expected += expected.values[i] * expected.values[i];
    if (absolute != 0) ++different;
  }
  const double count = static_cast<double>(expected.values.size());
  difference.mean_abs = sum / count;
  difference.fraction_different = static_cast<double>(different) / count;
  if (squared_difference > 0) difference.rel_l2 = std::sqrt(squared_difference / squared_expected);
  return difference;
}

}  // namespace antipode::golden
