#include "antipode/zero123/pose_projection.h"

#include <cmath>
#include <vector>

#include "antipode/geometry/rotation.h"

namespace antipode {

torch::Tensor PoseVector(std::span<const RelativeView> viewpoints) {
  std::vector<double> values;
  for (const RelativeView& viewpoint : viewpoints) {
    const double azimuth = RadiansFromDegrees(viewpoint.azimuth);
    values.insert(values.end(), {RadiansFromDegrees(viewpoint.polar), std::sin(azimuth), std::cos(azimuth), viewpoint.radius});
  }
  return torch::tensor(values, torch::kDouble).view({-1, 1, 4}).to(torch::kFloat);
}

PoseProjectionImpl::PoseProjectionImpl(std::int64_t width)
    : projection_(register_module("cc_projection", Dense(width + 4, width))) {}

torch::Tensor PoseProjectionImpl::forward(const torch::Tensor& embedding, const torch::Tensor& poses) const {
  return projection_->forward(at::cat({embedding.expand({poses.size(0), 1, embedding.size(2)}), poses.to(embedding.scalar_type())}, 2));
}

}  // namespace antipode
