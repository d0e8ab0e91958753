#include "antipode/pose/two_view_pose.h"

#include <array>
#include <chrono>

#include "antipode/util/error.h"

namespace antipode {
namespace {

/// Seconds since the last call, filed under a name.
class Stopwatch {
 public:
  double Lap() {
    const auto now = std::chrono::steady_clock::now();
    return std::chrono::duration<double>(now - std::exchange(last_, now)).count();
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

void AddWarnings(const std::string& whose, const std::vector<std::string>& from,
                 std::vector<std::string>& to) {
  for (const std::string& warning : from) to.push_back(whose + ": " + warning);
}

}  // namespace

void TwoViewPoseOptions::Check() const {
  if (hypotheses < 1 || hypotheses > 50)
    throw InvalidOption("hypotheses", "is " + std::to_string(hypotheses), "use 1 to 50");
}

TwoViewPose EstimatePose(const ObjectPrior& prior, const ObjectPhotograph& reference,
                         const ObjectPhotograph& query, const TwoViewPoseOptions& options) {
  options.Check();
  TwoViewPose result;
  Stopwatch stopwatch;
  std::array<ObjectView, 2> views{
      MakeObjectView(reference.image, reference.mask, reference.camera, prior.ViewOptions()),
      MakeObjectView(query.image, query.mask, query.camera, prior.ViewOptions())};
  result.timings_s["crop"] = stopwatch.Lap();

  const torch::Tensor codes = prior.Encode(views);
  result.timings_s["encode"] = stopwatch.Lap();

  const std::vector<RotationMode> modes =
      prior.Compare(codes[0], codes[1], {.max_modes = options.hypotheses});
  result.timings_s["compare"] = stopwatch.Lap();

  for (const RotationMode& mode : modes)
    result.hypotheses.push_back({ComposeFromCrops(views[0], views[1], mode.rotation), mode.probability});
  result.query_from_reference = result.hypotheses.front().query_from_reference;
  result.confidence = prior.Confidence(modes.front().probability);
  AddWarnings("reference", views[0].warnings, result.warnings);
  AddWarnings("query", views[1].warnings, result.warnings);
  result.reference = std::move(views[0]);
  result.query = std::move(views[1]);
  return result;
}

}  // namespace antipode
