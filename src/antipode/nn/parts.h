#pragma once

#include <memory>
#include <string>

#include <torch/torch.h>

#include "antipode/weights/safetensors.h"

namespace antipode {

/// Registers `part` under a name with dots, as checkpoints spell it ("block1.0.layer.0"), with
/// empty modules for the steps in between.
void RegisterAt(torch::nn::Module& root, const std::string& name,
                std::shared_ptr<torch::nn::Module> part);

/// The tensors whose names begin with `prefix`, without it.
TensorFile WithoutPrefix(const TensorFile& file, const std::string& prefix);

/// Adds all tensors of `part` to `file`, with `prefix` before their names.
void AddWithPrefix(TensorFile& file, const TensorFile& part, const std::string& prefix);

}  // namespace antipode
