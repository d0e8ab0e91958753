#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <torch/torch.h>

#include "antipode/matching/matcher.h"
#include "antipode/nn/layers.h"
#include "antipode/orientation/nearby_views.h"
#include "antipode/synthesis/view_synthesizer.h"
#include "antipode/util/progress.h"

namespace antipode {

/// How the camera of a photograph stands to the vertical axis of its object.
struct Orientation {
  double elevation_deg = 0;          ///< of the camera above the object's horizon
  double in_plane_rotation_deg = 0;  ///< positive: the photograph is turned clockwise
  double certainty = 0;              ///< 0..1; of the code: how often its up direction is within 15 degrees
  std::string source;                ///< "code" or "search"
};

/// From the object's up direction in camera axes, u = (sin g cos e, -cos g cos e, -sin e).
Orientation OrientationFromUp(const Eigen::Vector3d& up_in_camera, double certainty = 1);
Eigen::Vector3d UpFromOrientation(const Orientation& orientation);

/// Reads the up direction from an object code: dense, GELU, dense.
class UprightReadoutImpl : public torch::nn::Module {
 public:
  UprightReadoutImpl(std::int64_t code_size, std::int64_t hidden);

  struct Output {
    torch::Tensor up;        ///< [N, 3], of length 1, camera axes
    torch::Tensor log_odds;  ///< [N], that it is within 15 degrees of the truth
  };
  Output forward(const torch::Tensor& codes) const;  // [N, code_size]

 private:
  Dense hidden_, up_;
};
TORCH_MODULE(UprightReadout);

/// The direct estimate: milliseconds, and no view synthesis.
class UprightEstimator {
 public:
  /// @throws BadFile if it belongs to another prior than the one with `prior_sha256`
  static UprightEstimator Load(const std::string& model, const std::string& prior_sha256);

  /// @param code of ObjectPrior::Encode, of the crop
  /// @param crop_from_camera of the crop
  Orientation Estimate(const torch::Tensor& code) const;

 private:
  explicit UprightEstimator(UprightReadout readout) : readout_(std::move(readout)) {}
  UprightReadout readout_;
};

/// A synthesiser for the photograph turned counter-clockwise by an angle.
using SynthesizerOfTurned = std::function<std::unique_ptr<ViewSynthesizer>(double turn_deg)>;

struct OrientationSearchOptions {
  /// In-plane rotations to try first; {0} leaves them alone.
  std::vector<double> in_plane_rotations_deg{-40, -20, 0, 20, 40};
  double finest_step_deg = 5;  ///< steps are halved down to this, then a parabola
  void Check() const;
};

/// Elevation alone: four nearby views, their matches, the search of nearby_views.h.
ElevationEstimate EstimateElevation(const ViewSynthesizer& synthesizer, const Matcher& matcher, const ProgressCallback& progress = {});

/// The search of the paper's section 3.2: the in-plane rotation with which the nearby views fit an upright camera best,
/// coarse to fine, and the elevation there. Certainty: how much better it fits than the second best coarse rotation.
/// @throws Error if no turn has enough matches
Orientation SearchOrientation(const SynthesizerOfTurned& synthesizer, const Matcher& matcher,
                              const OrientationSearchOptions& options = {}, const ProgressCallback& progress = {});

}  // namespace antipode
