#include "antipode/matching/feature_matches.h"

namespace antipode {

FeatureMatches MatchMutualNearest(const torch::Tensor& reference, const torch::Tensor& query) {
  const auto similarity = torch::mm(reference, query.t());
  const auto [scores, nearest] = similarity.max(1);
  const auto back = similarity.argmax(0).index_select(0, nearest);
  const auto mutual = (back == torch::arange(back.size(0), back.options())).nonzero().squeeze(1);
  return {mutual, nearest.index_select(0, mutual), scores.index_select(0, mutual)};
}

}  // namespace antipode
