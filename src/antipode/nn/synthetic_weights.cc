#include "antipode/nn/synthetic_weights.h"

#include <cmath>

#include "antipode/util/seeds.h"

namespace antipode {

torch::Tensor SyntheticUniform(const std::string& name, const std::vector<std::int64_t>& shape) {
  auto tensor = torch::empty(shape, torch::kDouble);
  double* values = tensor.data_ptr<double>();
  const std::uint64_t seed = HashOfName(name);
  for (std::int64_t i = 0; i < tensor.numel(); ++i)
    values[i] = static_cast<double>(CombineSeeds(seed, static_cast<std::uint64_t>(i)) >> 11) * 0x1.0p-53 * 2 - 1;
  return tensor;
}

torch::Tensor SyntheticTensor(const std::string& name, const std::vector<std::int64_t>& shape) {
  auto u = SyntheticUniform(name, shape);
  if (shape.size() >= 2) {
    const double fan_in = static_cast<double>(u.numel()) / static_cast<double>(shape[0]);
    u = u * std::sqrt(3 / fan_in);
  } else if (name.ends_with("running_var") || name.ends_with(".weight")) {
    u = 1 + 0.1 * u;
  } else {
    u = 0.1 * u;
  }
  return u.to(torch::kFloat);
}

void FillSynthetic(torch::nn::Module& module, const std::string& prefix) {
  const torch::NoGradGuard no_gradient;
  for (auto& item : module.named_parameters())
    item.value().copy_(SyntheticTensor(prefix + item.key(), item.value().sizes().vec()));
  for (auto& item : module.named_buffers())
    if (!item.key().ends_with("num_batches_tracked"))
      item.value().copy_(SyntheticTensor(prefix + item.key(), item.value().sizes().vec()));
}

}  // namespace antipode
