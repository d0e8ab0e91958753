#pragma once

#include <string>

#include "antipode/weights/safetensors.h"

namespace antipode {

/// SHA-256 of the names and values of all tensors, whatever the metadata.
std::string Sha256OfTensors(const TensorFile& file);

}  // namespace antipode
