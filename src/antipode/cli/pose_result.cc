#include "antipode/cli/pose_result.h"

#include <algorithm>
#include <cmath>

#include "antipode/geometry/rotation.h"
#include "antipode/report/confidence_words.h"
#include "antipode/util/formatted.h"
#include "antipode/util/version.h"

namespace antipode {
namespace {

using Json = nlohmann::ordered_json;

Json RowsOf(const Eigen::Matrix3d& matrix) {
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i) rows.push_back({matrix(i, 0), matrix(i, 1), matrix(i, 2)});
  return rows;
}

Json ListOf(const Eigen::VectorXd& vector) { return std::vector<double>(vector.begin(), vector.end()); }

bool IsInMetres(const PoseResult& result) {
  return result.object_size || result.pose.length_unit == LengthUnit::kDepth;
}

/// What the lengths of the pose are multiplied by.
double Scale(const PoseResult& result) {
  return result.pose.length_unit == LengthUnit::kDepth ? 1 : 0.5 * result.object_size.value_or(2);
}

std::string UnitOf(const PoseResult& result) { return IsInMetres(result) ? "metre" : "object radius"; }

Json HypothesisJson(const PoseHypothesis& hypothesis, double scale) {
  const Rigid3& pose = hypothesis.query_from_reference;
  return {{"rotation", RowsOf(pose.rotation)},
          {"quaternion_wxyz", ListOf(QuaternionWxyz(pose.rotation))},
          {"translation", ListOf(scale * pose.translation)},
          {"rotation_angle_deg", RotationAngleDeg(pose.rotation)},
          {"probability", hypothesis.probability},
          {"source", hypothesis.source}};
}

Json TimingsJson(const PoseResult& result) {
  Json timings = {{"load", result.load_seconds}};
  for (const auto& [stage, seconds] : result.pose.timings_s) timings[stage] = seconds;
  timings["total"] = result.total_seconds;
  return timings;
}

std::string VectorText(const Eigen::Vector3d& v) {
  // Adding zero turns -0 into 0.
  const auto rounded = [](double value, double unit) { return std::round(value / unit) * unit + 0.0; };
  return Formatted("(%.3f, %.3f, %.3f)", rounded(v.x(), 1e-3), rounded(v.y(), 1e-3), rounded(v.z(), 1e-3));
}

std::string RotationText(const Eigen::Matrix3d& rotation) {
  const double angle = RotationAngleDeg(rotation);
  if (angle < 1e-3) return "0.0 degrees";
  return Formatted("%.1f degrees about ", angle) + VectorText(VectorFromRotation(rotation).normalized());
}

std::string Line(const std::string& label, const std::string& value) {
  return Formatted("  %-13s%s\n", label.c_str(), value.c_str());
}

std::string HypothesesText(const PoseResult& result) {
  std::string text;
  for (std::size_t i = 0; i < result.pose.hypotheses.size(); ++i) {
    const PoseHypothesis& hypothesis = result.pose.hypotheses[i];
    text += Line(i == 0 ? "hypotheses" : "",
                 Formatted("%zu. %5.1f %%   ", i + 1, 100 * hypothesis.probability) +
                     RotationText(hypothesis.query_from_reference.rotation));
  }
  return text;
}

}  // namespace

std::vector<std::string> PoseResult::Warnings() const {
  std::vector<std::string> all;
  for (const auto* list : {&reference.warnings, &query.warnings, &pose.warnings}) {
    for (const std::string& warning : *list)
      if (std::ranges::find(all, warning) == all.end()) all.push_back(warning);
  }
  return all;
}

Json ToJson(const PoseResult& result) {
  const Rigid3& pose = result.pose.query_from_reference;
  const double scale = Scale(result);
  Json hypotheses = Json::array();
  for (const PoseHypothesis& hypothesis : result.pose.hypotheses)
    hypotheses.push_back(HypothesisJson(hypothesis, scale));
  return {{"antipode", Version()},
          {"method", result.method},
          {"model", result.model},
          {"query_from_reference",
           {{"rotation", RowsOf(pose.rotation)},
            {"quaternion_wxyz", ListOf(QuaternionWxyz(pose.rotation))},
            {"translation", ListOf(scale * pose.translation)},
            {"translation_unit", UnitOf(result)}}},
          {"rotation_angle_deg", RotationAngleDeg(pose.rotation)},
          {"confidence", result.pose.confidence},
          {"hypotheses", hypotheses},
          {"evidence", result.pose.evidence},
          {"reference", ToJson(result.reference)},
          {"query", ToJson(result.query)},
          {"timings_s", TimingsJson(result)},
          {"warnings", result.Warnings()}};
}

std::string ToText(const PoseResult& result) {
  const Rigid3& pose = result.pose.query_from_reference;
  const Eigen::Vector4d q = QuaternionWxyz(pose.rotation);
  std::string text = "Pose of the query camera as seen from the reference camera: x_query = R x_reference + t\n";
  text += "(camera axes: x right, y down, z forward)\n\n";
  text += Line("rotation", RotationText(pose.rotation));
  text += Line("quaternion", Formatted("w %.4f  x %.4f  y %.4f  z %.4f", q[0], q[1], q[2], q[3]));
  text += Line("translation", VectorText(Scale(result) * pose.translation) +
                                  (IsInMetres(result) ? " metres" : " object radii"));
  text += Line("confidence", Formatted("%.0f %%, ", 100 * result.pose.confidence) +
                                 ConfidenceWords(result.pose.confidence));
  text += "\n" + HypothesesText(result) + "\n";
  text += Line("reference", Describe(result.reference));
  text += Line("query", Describe(result.query));
  text += Line("time", Formatted("%.0f ms, after %.2f s of loading",
                                   1e3 * (result.total_seconds - result.load_seconds), result.load_seconds));
  for (const std::string& warning : result.Warnings()) text += Line("warning", warning);
  return text;
}

}  // namespace antipode
