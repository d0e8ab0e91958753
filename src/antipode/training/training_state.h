#pragma once

#include <cstdint>
#include <map>
#include <string>

#include <torch/torch.h>

#include "antipode/weights/safetensors.h"

namespace antipode {

/// Exponential moving average of a network's parameters, by name.
using MovingAverage = std::map<std::string, torch::Tensor>;

MovingAverage StartAverage(const torch::nn::Module& network);

/// Moves towards the trained parameters by 1 - min(decay, (1 + step) / (10 + step)).
void UpdateAverage(MovingAverage& average, const torch::nn::Module& network, double decay, std::int64_t step);

/// Parameters and buffers, their average and the optimiser's moments, so that training resumes exactly: tensors
/// `weight/NAME`, `average/NAME`, `adam1/NAME`, `adam2/NAME`, metadata `adam_step/NAME`.
void AddTrainingState(TensorFile& file, const torch::nn::Module& network, const MovingAverage& average, torch::optim::AdamW& optimizer);
void RestoreTrainingState(const TensorFile& file, torch::nn::Module& network, MovingAverage& average, torch::optim::AdamW& optimizer);

}  // namespace antipode
