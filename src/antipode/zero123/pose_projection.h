#pragma once

#include <span>

#include <torch/torch.h>

#include "antipode/nn/layers.h"

namespace antipode {

/// Where to look from, relative to the picture's own viewpoint.
struct RelativeViewpoint {
  double polar_deg = 0;    ///< change of the angle from the vertical axis: positive moves the camera down
  double azimuth_deg = 0;  ///< counter-clockwise seen from above
  double radius = 0;       ///< change of the camera's distance
};

/// [polar, sin(azimuth), cos(azimuth), radius] in radians, computed in double.
/// @return [P, 1, 4], float32
torch::Tensor PoseVector(std::span<const RelativeViewpoint> viewpoints);

/// W [e ; T] + b: CLIP's embedding of the picture and the pose vector become the context. `cc_projection.*`.
class PoseProjectionImpl : public torch::nn::Module {
 public:
  explicit PoseProjectionImpl(std::int64_t width = 768);
  /// @param embedding [P or 1, 1, width]
  /// @param poses [P, 1, 4]
  /// @return [P, 1, width]
  torch::Tensor forward(const torch::Tensor& embedding, const torch::Tensor& poses) const;

 private:
  Dense projection_;
};
TORCH_MODULE(PoseProjection);

}  // namespace antipode
