#pragma once

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

}  // namespace antipode
