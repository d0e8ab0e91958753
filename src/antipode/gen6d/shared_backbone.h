#pragma once

#include <string>

#include <torch/torch.h>

#include "antipode/weights/safetensors.h"

/// The built-in networks are stored without their backbone: it is that of the object prior, which ships anyway.
namespace antipode {

/// Whether a parameter belongs to the backbone: `backbone.*` or `feature_net.backbone.*`.
bool IsBackbone(const std::string& parameter);

TensorFile WithoutBackbone(TensorFile file);

/// Copies the backbone out of a model: EfficientNet-Lite0 out of a prior, VGG-11 out of an imported selector.
/// @throws BadFile if the model has no such backbone
void UseSharedBackbone(torch::nn::Module& network, const std::string& model);

/// Hash of the backbone's values in a model.
std::string SharedBackboneHash(const std::string& model);

/// Copies everything but the backbone. @throws BadFile as LoadInto
void LoadBesideBackbone(torch::nn::Module& network, const TensorFile& file, const std::string& source);

/// A whole network from a model with or without a backbone of its own.
/// @throws BadFile if it was trained with another backbone than the one that is installed
void LoadWithBackbone(torch::nn::Module& network, const TensorFile& file, const std::string& source);

}  // namespace antipode
