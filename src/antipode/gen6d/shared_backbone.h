#pragma once

#include <string>

#include <torch/torch.h>

#include "antipode/weights/safetensors.h"

/// The built-in networks are stored without their backbone: it is that of the object prior, which ships anyway.
namespace antipode {

/// Whether a parameter belongs to the backbone: `backbone.*` or `feature_net.backbone.*`.
bool IsBackbone(const std::string& parameter);

TensorFile WithoutBackbone(TensorFile file);

/// The backbone of a model that others share: EfficientNet-Lite0 of a prior, VGG-11 of an imported selector.
struct SharedBackbone {
  TensorFile tensors;  ///< without the prefix `backbone.`
  std::string sha256;  ///< of its names and values
};

/// @throws BadFile if the model has no backbone
SharedBackbone LoadSharedBackbone(const std::string& model);

/// A whole network: the backbone, and everything else from `rest`. @throws BadFile as LoadInto
void LoadBesideBackbone(torch::nn::Module& network, TensorFile rest, const SharedBackbone& backbone, const std::string& source);

/// A whole network from a model with or without a backbone of its own.
/// @throws BadFile if it was trained with another backbone than the one that is installed
void LoadWithBackbone(torch::nn::Module& network, const TensorFile& file, const std::string& source);

}  // namespace antipode
