#pragma once

#include <string>

#include <torch/torch.h>

#include "antipode/weights/safetensors.h"

namespace antipode {

torch::Tensor ToTorch(const HostTensor& tensor);                ///< a copy, same dtype, on the CPU
HostTensor FromTorch(const torch::Tensor& tensor);              ///< a copy, from any device

/// Copies every parameter and buffer of `module` from the tensor of the same name, converted to its dtype.
/// @param source the file or model, for messages
/// @throws BadFile listing all missing, extra and wrongly shaped tensors, or the ones that are not finite
void LoadInto(torch::nn::Module& module, const TensorFile& file, const std::string& source);

/// The same, tensor by tensor. On the CPU, parameters of the mapped values' own dtype refer to them and must not be
/// trained: memory that the system can drop and share, and nothing is copied.
void LoadInto(torch::nn::Module& module, const LazyTensorFile& file, const std::string& source);

/// All parameters and floating-point buffers by name.
TensorFile WeightsOf(const torch::nn::Module& module);

}  // namespace antipode
