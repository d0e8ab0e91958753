#pragma once

#include <string>

#include <torch/torch.h>

namespace antipode {

/// "auto" (CUDA if there is a usable device), "cpu" or "cuda".
/// @throws InvalidOption for another name, or for "cuda" where none can be used
torch::Device SelectDevice(const std::string& name);

}  // namespace antipode
