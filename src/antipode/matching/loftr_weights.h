#pragma once

#include <string>

#include "antipode/weights/safetensors.h"

namespace antipode {

/// The model that holds the weights of LoFTR.
inline constexpr char kLoftrModel[] = "loftr";

/// LoFTR's weights out of the published checkpoint `indoor_ds_new.ckpt`, whose tensors are named
/// `state_dict.matcher.NAME`; also of one with plain names.
/// @throws BadFile naming the model that the checkpoint is of, if it is of another one; else
/// listing what is missing,
///         does not belong or has another shape
TensorFile LoftrWeights(const TensorFile& checkpoint, const std::string& source);

}  // namespace antipode
