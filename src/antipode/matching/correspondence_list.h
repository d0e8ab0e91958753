#pragma once

#include <torch/torch.h>

#include "antipode/matching/matcher.h"

namespace antipode {

/// @param reference,query [K, 2] pixels
/// @param scores [K]; clipped to 0..1
Correspondences ToCorrespondences(const torch::Tensor& reference, const torch::Tensor& query,
                                  const torch::Tensor& scores);

}  // namespace antipode
