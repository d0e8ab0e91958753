#include "antipode/prior/correlation.h"

#include <cmath>
#include <vector>

namespace antipode {

torch::Tensor CorrelateCodes(const torch::Tensor& query, const torch::Tensor& reference, int max_degree) {
  std::vector<torch::Tensor> blocks;
  for (int l = 0; l <= max_degree; ++l) {
    const auto degree = torch::indexing::Slice(l * l, (l + 1) * (l + 1));
    const auto q = query.index({"...", degree}), r = reference.index({"...", degree});
    blocks.push_back(torch::bmm(q.transpose(1, 2), r).flatten(1));
  }
  return torch::cat(blocks, 1);
}

torch::Tensor NegativeLogDensity(const torch::Tensor& correlations, const torch::Tensor& true_wigner,
                                 const torch::Tensor& grid_wigner) {
  const auto true_score = (correlations * true_wigner).sum(1);
  const auto grid_scores = torch::matmul(correlations, grid_wigner.t());
  const double log_count = std::log(static_cast<double>(grid_wigner.size(0)));
  return torch::logsumexp(grid_scores, 1) - log_count - true_score;
}

}  // namespace antipode
