#include "antipode/gen6d/losses.h"

#include <numbers>

namespace antipode {

using torch::Tensor;

Tensor ViewSelectionLoss(const Tensor& logits, const Tensor& scores) {
  const Tensor lowest = scores.amin(1, true), highest = scores.amax(1, true);
  const Tensor wanted = (scores - lowest) / (highest - lowest).clamp_min(1e-4);
  return at::binary_cross_entropy_with_logits(logits, wanted, {}, {}, at::Reduction::None).mean(1);
}

Tensor InPlaneAngleLoss(const Tensor& angles, const Tensor& true_angles, const Tensor& nearest) {
  const Tensor at_nearest = angles.gather(1, nearest.unsqueeze(1)).squeeze(1);
  return (at_nearest - true_angles * (2 / std::numbers::pi)).square();
}

Tensor RotationMatrices(const Tensor& quaternions) {
  const auto parts = quaternions.unbind(1);
  const Tensor &w = parts[0], &x = parts[1], &y = parts[2], &z = parts[3];
  return at::stack({1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),      //
                    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),      //
                    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
                   1)
      .view({-1, 3, 3});
}

Tensor PoseChangeLoss(const RefinerOutput& output, const Tensor& points, const Tensor& centres, const Tensor& target) {
  const Tensor linear = at::exp2(output.scale).unsqueeze(2) * RotationMatrices(output.rotation);  // [B, 3, 3]
  const Tensor offset = at::cat({output.offset, at::zeros_like(output.offset.slice(1, 0, 1))}, 1);
  const Tensor middle = centres.unsqueeze(1);  // [B, 1, 3]
  const Tensor moved = at::matmul(points - middle, linear.transpose(1, 2)) + middle + offset.unsqueeze(1);
  const Tensor wanted = at::matmul(points, target.slice(2, 0, 3).transpose(1, 2)) + target.select(2, 3).unsqueeze(1);
  return (moved - wanted).square().sum(2).mean(1);
}

}  // namespace antipode
