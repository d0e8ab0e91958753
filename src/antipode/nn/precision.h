#pragma once

#include <torch/torch.h>

namespace antipode {

/// Whether the processor multiplies bfloat16 matrices in hardware (AVX-512 BF16, which every processor with AMX has too).
bool ProcessorHasBFloat16();

/// Runs matrix products and convolutions in bfloat16 while it lives, if `enabled`.
class BFloat16Autocast {
 public:
  BFloat16Autocast(torch::DeviceType device, bool enabled);
  ~BFloat16Autocast();
  BFloat16Autocast(const BFloat16Autocast&) = delete;
  BFloat16Autocast& operator=(const BFloat16Autocast&) = delete;

 private:
  torch::DeviceType device_;
  bool was_enabled_;
};

}  // namespace antipode
