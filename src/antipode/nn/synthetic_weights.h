#pragma once

#include <string>
#include <vector>

#include <torch/torch.h>

namespace antipode {

/// Deterministic stand-ins for trained weights, the same in any language: they let two implementations of
/// a network be compared without its real weights.
///
/// The number of flat index i of the tensor NAME is u in [-1, 1): SplitMix64 of the FNV-1a hash of NAME.
/// Rank 2 and more: u sqrt(3 / fan_in); running_var: 1 + 0.1 u; rank 1 ending in .weight: 1 + 0.1 u;
/// other rank 1: 0.1 u. Computed in double, rounded to float32.
torch::Tensor SyntheticTensor(const std::string& name, const std::vector<std::int64_t>& shape);

/// u itself, in double.
torch::Tensor SyntheticUniform(const std::string& name, const std::vector<std::int64_t>& shape);

/// Fills every parameter and buffer of `module`; names are prefixed by `prefix`.
void FillSynthetic(torch::nn::Module& module, const std::string& prefix = {});

}  // namespace antipode
