#include "antipode/nn/device.h"

#include "antipode/util/error.h"

namespace antipode {

torch::Device SelectDevice(const std::string& name) {
  if (name == "cpu") return torch::kCPU;
  const bool has_cuda = torch::cuda::is_available();
  if (name == "auto") return has_cuda ? torch::kCUDA : torch::kCPU;
  if (name != "cuda") throw InvalidOption("device", "'" + name + "' is unknown", "use auto, cpu or cuda");
  if (!has_cuda)
    throw InvalidOption("device", "no CUDA device can be used", "use --device cpu, or run 'antipode doctor'");
  return torch::kCUDA;
}

}  // namespace antipode
