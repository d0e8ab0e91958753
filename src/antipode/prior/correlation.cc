#include "antipode/prior/correlation.h"

#include <cmath>
#include <vector>

namespace antipode {
namespace {

std::vector<Eigen::Matrix3d> RotationsFrom(const torch::Tensor& tensor) {
  const torch::Tensor rows = tensor.to(torch::kCPU, torch::kDouble).reshape({-1, 9}).contiguous();
  std::vector<Eigen::Matrix3d> rotations;
  for (std::int64_t i = 0; i < rows.size(0); ++i)
    rotations.emplace_back(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.const_data_ptr<double>() + 9 * i));
  return rotations;
}

}  // namespace

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

torch::Tensor ToTensor(const RowMajorMatrixXf& rows) {
  return torch::from_blob(const_cast<float*>(rows.data()), {rows.rows(), rows.cols()}, torch::kFloat).clone();
}

int MaxDegreeOf(const torch::Tensor& codes) {
  return static_cast<int>(std::lround(std::sqrt(static_cast<double>(codes.size(-1))))) - 1;
}

torch::Tensor TurnCode(const torch::Tensor& code, const Eigen::Matrix3d& rotation) {
  return TurnCodes(code.unsqueeze(0), ToTensor(std::span(&rotation, 1)).unsqueeze(0))[0][0];
}

torch::Tensor TurnCodes(const torch::Tensor& codes, const torch::Tensor& rotations) {
  const int max_degree = MaxDegreeOf(codes);
  const std::int64_t batch = rotations.size(0), count = rotations.size(1);
  const torch::Tensor wigner = ToTensor(WignerMatrices(RotationsFrom(rotations), max_degree)).to(codes.device());
  std::vector<torch::Tensor> degrees;
  for (int l = 0; l <= max_degree; ++l) {
    const torch::Tensor block = wigner.slice(1, WignerOffset(l), WignerOffset(l + 1)).view({batch, count, 2 * l + 1, 2 * l + 1});
    degrees.push_back(torch::matmul(codes.slice(2, l * l, (l + 1) * (l + 1)).unsqueeze(1), block.transpose(2, 3)));
  }
  return torch::cat(degrees, 3);
}

torch::Tensor NegativeLogDensity(const torch::Tensor& correlations, const torch::Tensor& true_wigner,
                                 const torch::Tensor& grid_wigner) {
  const auto true_score = (correlations * true_wigner).sum(1);
  const auto grid_scores = torch::matmul(correlations, grid_wigner.t());
  const double log_count = std::log(static_cast<double>(grid_wigner.size(0)));
  return torch::logsumexp(grid_scores, 1) - log_count - true_score;
}

}  // namespace antipode
