#include "antipode/evaluation/baselines.h"

#include <array>
#include <map>
#include <sstream>
#include <vector>

#include "antipode/geometry/rotation.h"
#include "antipode/matching/depth_pose.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

TwoViewPose EstimateFromDepth(const Matcher& matcher, DepthSolver solver, const ObjectPhotograph& reference,
                              const ObjectPhotograph& query) {
  if (reference.depth.empty() || (solver == DepthSolver::kProcrustes && query.depth.empty()))
    throw Error("depth baseline", "there is no depth", "give --reference-depth");
  const Correspondences matches = matcher.Match(reference.image, query.image);
  const CameraPair cameras{reference.camera, query.camera};
  const auto pose = solver == DepthSolver::kPnp
                        ? PoseFromPnp(matches, cameras, reference.depth)
                        : PoseFromProcrustes(matches, cameras, reference.depth, query.depth);
  if (!pose) throw Error("depth baseline", "found no consistent pose");
  TwoViewPose result;
  result.query_from_reference = *pose;
  result.length_unit = LengthUnit::kDepth;
  result.hypotheses = {{*pose, result.confidence, "matching"}};
  result.evidence["matches"] = static_cast<double>(matches.size());
  result.reference = MakeObjectView(reference.image, reference.mask, reference.camera);
  result.query = MakeObjectView(query.image, query.mask, query.camera);
  result.warnings.emplace_back("a pose from depth has no calibrated confidence; 0 is stated");
  return result;
}

std::vector<std::string> SplitLine(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream stream(line);
  for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
  if (!line.empty() && line.back() == ',') fields.emplace_back();
  return fields;
}

using PairName = std::array<std::string, 3>;  // object, reference, query

/// Reads the CSV file line by line, columns by name.
class PredictionFile {
 public:
  explicit PredictionFile(const fs::path& path) : path_(path), stream_(ReadFile(path)) {
    std::string header;
    NextLine(header);
    const std::vector<std::string> names = SplitLine(header);
    for (std::size_t i = 0; i < names.size(); ++i) columns_[names[i]] = i;
    for (const char* needed : {"object", "reference", "query", "qw", "qx", "qy", "qz", "tx", "ty", "tz"})
      if (!columns_.contains(needed))
        throw BadFile(path_.string(), std::string("has no column ") + needed,
                      "its first line must name object,reference,query,qw,qx,qy,qz,tx,ty,tz");
  }

  std::map<PairName, TwoViewPose> Read() {
    std::map<PairName, TwoViewPose> poses;
    for (std::string line; NextLine(line);) {
      if (line.empty()) continue;
      fields_ = SplitLine(line);
      if (fields_.size() < columns_.size()) Fail("has too few fields");
      poses[{Text("object"), Text("reference"), Text("query")}] = Pose();
    }
    return poses;
  }

 private:
  bool NextLine(std::string& line) {
    ++number_;
    if (!std::getline(stream_, line)) return false;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return true;
  }

  [[noreturn]] void Fail(const std::string& problem) const {
    throw BadFile(path_.string(), "line " + std::to_string(number_) + " " + problem, "correct it");
  }

  const std::string& Text(const std::string& column) const { return fields_[columns_.at(column)]; }

  double Number(const std::string& column) const {
    const std::string& text = Text(column);
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (text.empty() || *end != '\0' || !std::isfinite(value)) Fail("has no number in column " + column);
    return value;
  }

  TwoViewPose Pose() const {
    const Eigen::Vector4d quaternion(Number("qw"), Number("qx"), Number("qy"), Number("qz"));
    if (!(quaternion.norm() > 0)) Fail("has a quaternion of length 0");
    TwoViewPose pose;
    pose.query_from_reference = {RotationFromQuaternionWxyz(quaternion), {Number("tx"), Number("ty"), Number("tz")}};
    if (columns_.contains("confidence")) pose.confidence = Number("confidence");
    return pose;
  }

  fs::path path_;
  std::istringstream stream_;
  std::map<std::string, std::size_t> columns_;
  std::vector<std::string> fields_;
  int number_ = 0;
};

}  // namespace

PoseMethod DepthBaseline(std::string name, std::shared_ptr<const Matcher> matcher, DepthSolver solver) {
  return OnPhotographs(std::move(name),
                       [matcher = std::move(matcher), solver](const ObjectPhotograph& reference, const ObjectPhotograph& query) {
                         return EstimateFromDepth(*matcher, solver, reference, query);
                       });
}

PoseMethod Predictions(const fs::path& csv) {
  return {"predictions " + csv.filename().string(),
          [poses = PredictionFile(csv).Read()](const PairToEstimate& pair) {
            const auto found = poses.find({pair.object, pair.reference.name, pair.query.name});
            if (found == poses.end()) throw Error("predictions", "lack this pair");
            return found->second;
          }};
}

}  // namespace antipode
