#include "antipode/training/training_state.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "antipode/nn/module_weights.h"

namespace antipode {
namespace {

using torch::Tensor;

torch::optim::AdamWParamState* MomentsOf(const Tensor& parameter, torch::optim::AdamW& optimizer) {
  const auto found = optimizer.state().find(parameter.unsafeGetTensorImpl());
  if (found == optimizer.state().end()) return nullptr;
  return static_cast<torch::optim::AdamWParamState*>(found->second.get());
}

void RestoreMoments(const Tensor& parameter, const std::string& name, const TensorFile& file, torch::optim::AdamW& optimizer) {
  auto state = std::make_unique<torch::optim::AdamWParamState>();
  state->step(std::stoll(file.metadata.at("adam_step/" + name)));
  state->exp_avg(ToTorch(file.tensors.at("adam1/" + name)).view(parameter.sizes()).to(parameter.device()));
  state->exp_avg_sq(ToTorch(file.tensors.at("adam2/" + name)).view(parameter.sizes()).to(parameter.device()));
  optimizer.state()[parameter.unsafeGetTensorImpl()] = std::move(state);
}

}  // namespace

MovingAverage StartAverage(const torch::nn::Module& network) {
  MovingAverage average;
  for (const auto& item : network.named_parameters()) average[item.key()] = item.value().detach().clone();
  return average;
}

void UpdateAverage(MovingAverage& average, const torch::nn::Module& network, double decay, std::int64_t step) {
  const torch::NoGradGuard no_gradient;
  const double now = std::min(decay, (1.0 + static_cast<double>(step)) / (10.0 + static_cast<double>(step)));
  for (const auto& item : network.named_parameters())
    if (item.value().requires_grad()) average.at(item.key()).lerp_(item.value(), 1 - now);
}

void AddTrainingState(TensorFile& file, const torch::nn::Module& network, const MovingAverage& average, torch::optim::AdamW& optimizer) {
  for (const auto& item : network.named_parameters()) {
    file.tensors["weight/" + item.key()] = FromTorch(item.value());
    file.tensors["average/" + item.key()] = FromTorch(average.at(item.key()));
    const auto* moments = MomentsOf(item.value(), optimizer);
    if (moments == nullptr) continue;
    file.tensors["adam1/" + item.key()] = FromTorch(moments->exp_avg());
    file.tensors["adam2/" + item.key()] = FromTorch(moments->exp_avg_sq());
    file.metadata["adam_step/" + item.key()] = std::to_string(moments->step());
  }
  for (const auto& item : network.named_buffers()) file.tensors["weight/" + item.key()] = FromTorch(item.value());
}

void RestoreTrainingState(const TensorFile& file, torch::nn::Module& network, MovingAverage& average, torch::optim::AdamW& optimizer) {
  const torch::NoGradGuard no_gradient;
  const auto restore = [&](Tensor target, const std::string& name) {
    target.copy_(ToTorch(file.tensors.at(name)).view(target.sizes()));
  };
  for (auto& item : network.named_parameters()) {
    restore(item.value(), "weight/" + item.key());
    restore(average.at(item.key()), "average/" + item.key());
    if (file.tensors.contains("adam1/" + item.key())) RestoreMoments(item.value(), item.key(), file, optimizer);
  }
  for (auto& item : network.named_buffers()) restore(item.value(), "weight/" + item.key());
}

}  // namespace antipode
