#pragma once

#include <span>

#include <torch/torch.h>

#include "antipode/geometry/viewpoints.h"
#include "antipode/nn/layers.h"

namespace antipode {

/// [polar, sin(azimuth), cos(azimuth), radius] in radians, computed in double.
/// @return [P, 1, 4], float32
torch::Tensor PoseVector(std::span<const RelativeView> viewpoints);

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
