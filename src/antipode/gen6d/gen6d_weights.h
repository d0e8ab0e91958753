#pragma once

#include <string>

#include "antipode/weights/safetensors.h"

namespace antipode {

inline constexpr char kGen6dSelectorModel[] = "gen6d-selector";
inline constexpr char kGen6dRefinerModel[] = "gen6d-refiner";

/// The weights of Gen6D's networks out of the published checkpoints `selector_pretrain/model_best.pth` and
/// `refiner_pretrain/model_best.pth`, whose tensors are named `network_state_dict.NAME`; also of ones with plain names.
/// The configuration is in the metadata of the result.
/// @throws BadFile naming the model that the checkpoint is of, if it is of another one; else listing what is missing, does
///   not belong or has another shape
TensorFile Gen6dSelectorWeights(const TensorFile& checkpoint, const std::string& source);
TensorFile Gen6dRefinerWeights(const TensorFile& checkpoint, const std::string& source);

}  // namespace antipode
