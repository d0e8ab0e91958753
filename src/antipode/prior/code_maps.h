#pragma once

#include <span>

#include <Eigen/Core>
#include <torch/torch.h>

namespace antipode {

/// Codes scaled so that the mean square of their functions over the sphere and the channels is 1.
/// @param codes [N, C, (L + 1)^2]
torch::Tensor ScaledCodes(const torch::Tensor& codes);

/// How a camera would see codes: their functions f, scaled, on the near and on the far half of the unit sphere, which fills
/// the middle 1 / 1.1 of the map as the object's box fills an object-centric crop. At (x, y) in the view's axes, z the height
/// of the sphere above it (0 beyond its outline, whose nearest point is taken there), R = view_from_picture:
///   [f(R^T (x, y, -z)), f(R^T (x, y, z))].
/// @param codes [P, C, (L + 1)^2] of pictures, as ObjectPrior::Encode gives them
/// @return [P, 2 C, size, size], on the CPU
torch::Tensor CodeMaps(const torch::Tensor& codes, std::span<const Eigen::Matrix3d> view_from_picture, int size);

}  // namespace antipode
