#include "antipode/matching/correspondence_list.h"

namespace antipode {
namespace {

std::vector<Eigen::Vector2d> ToPoints(const torch::Tensor& points) {
  const auto host = points.to(torch::kCPU, torch::kDouble).contiguous();
  const double* values = host.const_data_ptr<double>();
  std::vector<Eigen::Vector2d> list;
  for (std::int64_t i = 0; i < host.size(0); ++i)
    list.emplace_back(values[2 * i], values[2 * i + 1]);
  return list;
}

}  // namespace

Correspondences ToCorrespondences(const torch::Tensor& reference, const torch::Tensor& query,
                                  const torch::Tensor& scores) {
  const auto host = scores.to(torch::kCPU, torch::kDouble).clamp(0, 1).contiguous();
  const double* values = host.const_data_ptr<double>();
  return {ToPoints(reference), ToPoints(query), {values, values + host.numel()}};
}

}  // namespace antipode
