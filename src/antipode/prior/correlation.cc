#include "antipode/prior/correlation.h"

#include <cmath>
#include <vector>

#include "antipode/geometry/wigner.h"

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

torch::Tensor ToTensor(std::span<const Eigen::Matrix3d> rotations) {
  auto tensor = torch::empty({static_cast<std::int64_t>(rotations.size()), 3, 3});
  for (std::size_t i = 0; i < rotations.size(); ++i)
    Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(tensor.data_ptr<float>() + 9 * i) = rotations[i].cast<float>();
  return tensor;
}

int MaxDegreeOf(const torch::Tensor& codes) {
  return static_cast<int>(std::lround(std::sqrt(static_cast<double>(codes.size(-1))))) - 1;
}

torch::Tensor TurnCode(const torch::Tensor& code, const Eigen::Matrix3d& rotation) {
  const int max_degree = MaxDegreeOf(code);
  const Eigen::VectorXf wigner = WignerMatrices(rotation, max_degree).cast<float>();
  std::vector<torch::Tensor> degrees;
  for (int l = 0; l <= max_degree; ++l) {
    const auto block = torch::from_blob(const_cast<float*>(wigner.data()) + WignerOffset(l), {2 * l + 1, 2 * l + 1});
    degrees.push_back(torch::matmul(code.slice(1, l * l, (l + 1) * (l + 1)), block.t()));
  }
  return torch::cat(degrees, 1);
}

torch::Tensor NegativeLogDensity(const torch::Tensor& correlations, const torch::Tensor& true_wigner,
                                 const torch::Tensor& grid_wigner) {
  const auto true_score = (correlations * true_wigner).sum(1);
  const auto grid_scores = torch::matmul(correlations, grid_wigner.t());
  const double log_count = std::log(static_cast<double>(grid_wigner.size(0)));
  return torch::logsumexp(grid_scores, 1) - log_count - true_score;
}

}  // namespace antipode
