#pragma once

#include <torch/torch.h>

namespace antipode {

/// Matches of two feature sets, each feature in at most one.
struct FeatureMatches {
  torch::Tensor reference;  ///< [K] int64, indices of features
  torch::Tensor query;      ///< [K] int64
  torch::Tensor scores;     ///< [K] float32

  std::int64_t size() const { return scores.size(0); }
};

/// Pairs of descriptors [M, D] and [N, D], M and N positive, that are each other's nearest by
/// scalar product, which is the score.
FeatureMatches MatchMutualNearest(const torch::Tensor& reference, const torch::Tensor& query);

}  // namespace antipode
