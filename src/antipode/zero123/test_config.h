#pragma once

#include <string>
#include <utility>

#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/zero123/zero123.h"

namespace antipode {

/// A Zero123 that a test runs in milliseconds.
inline Zero123Config TinyZero123() {
  Zero123Config config;
  config.unet = {.base_width = 32, .multipliers = {1, 2}, .residual_blocks = 1, .attention_factors = {1, 2}, .heads = 4, .context_width = 32};
  config.autoencoder = {.base_width = 32, .multipliers = {1, 1}, .residual_blocks = 1};
  config.clip = {.width = 32, .layers = 1, .heads = 2, .patch = 8, .output_width = 32, .image_size = 32};
  return config;
}

inline Zero123 SyntheticZero123(const Zero123Config& config) {
  Zero123 model(config);
  FillSynthetic(*model.unet);
  FillSynthetic(*model.autoencoder);
  FillSynthetic(*model.clip);
  FillSynthetic(*model.projection);
  return model;
}

/// As in the registry.
inline TensorFile AllWeightsOf(const Zero123& model, const Zero123Config& config) {
  TensorFile file{{}, config.ToMetadata()};
  const auto add = [&](const std::string& part, const torch::nn::Module& module) {
    for (auto& [name, tensor] : WeightsOf(module).tensors) file.tensors[part + name] = std::move(tensor);
  };
  add("unet.", *model.unet);
  add("autoencoder.", *model.autoencoder);
  add("clip.", *model.clip);
  add("projection.", *model.projection);
  return file;
}

}  // namespace antipode
