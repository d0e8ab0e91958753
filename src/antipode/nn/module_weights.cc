#include "antipode/nn/module_weights.h"

#include <cstring>

#include "antipode/util/error.h"
#include "antipode/weights/check.h"

namespace antipode {
namespace {

torch::Dtype TorchDtype(Dtype dtype) {
  switch (dtype) {
    case Dtype::kF64: return torch::kDouble;
    case Dtype::kF32: return torch::kFloat;
    case Dtype::kF16: return torch::kHalf;
    case Dtype::kBF16: return torch::kBFloat16;
    case Dtype::kI64: return torch::kLong;
    case Dtype::kI32: return torch::kInt;
    case Dtype::kI16: return torch::kShort;
    case Dtype::kI8: return torch::kChar;
    case Dtype::kU8: return torch::kByte;
    case Dtype::kBool: return torch::kBool;
  }
  throw Error("tensor", "has an unknown dtype");
}

Dtype HostDtype(torch::Dtype dtype) {
  for (const Dtype candidate : {Dtype::kF64, Dtype::kF32, Dtype::kF16, Dtype::kBF16, Dtype::kI64, Dtype::kI32,
                                Dtype::kI16, Dtype::kI8, Dtype::kU8, Dtype::kBool})
    if (TorchDtype(candidate) == dtype) return candidate;
  throw Error("tensor", "has a dtype that cannot be stored");
}

/// Parameters and buffers by name. `num_batches_tracked` counts training steps and is no weight.
std::map<std::string, torch::Tensor> TensorsOf(const torch::nn::Module& module) {
  std::map<std::string, torch::Tensor> tensors;
  for (const auto& item : module.named_parameters()) tensors[item.key()] = item.value();
  for (const auto& item : module.named_buffers())
    if (!item.key().ends_with("num_batches_tracked")) tensors[item.key()] = item.value();
  return tensors;
}

bool CanReferTo(const LazyTensor& lazy, const torch::Tensor& parameter) {
  const auto address = reinterpret_cast<std::uintptr_t>(lazy.mapped.bytes.data());
  return lazy.mapped.file != nullptr && TorchDtype(lazy.dtype) == parameter.scalar_type() && parameter.device().is_cpu() &&
         address % SizeOf(lazy.dtype) == 0;
}

torch::Tensor ReferTo(const LazyTensor& lazy) {
  void* const values = const_cast<std::byte*>(lazy.mapped.bytes.data());  // from_blob takes no pointer to const
  const auto keep = [file = lazy.mapped.file](void*) {};
  const auto options = torch::dtype(TorchDtype(lazy.dtype));
  if (lazy.mapped.layout == TensorLayout::kRowMajor) return torch::from_blob(values, lazy.shape, keep, options);
  const std::int64_t channels = lazy.shape.at(1), height = lazy.shape.at(2), width = lazy.shape.at(3);
  return torch::from_blob(values, lazy.shape, {channels * height * width, 1, channels * width, channels}, keep, options);
}

}  // namespace

torch::Tensor ToTorch(const HostTensor& tensor) {
  auto result = torch::empty(tensor.shape, TorchDtype(tensor.dtype));
  std::memcpy(result.data_ptr(), tensor.data.data(), tensor.data.size());
  return result;
}

HostTensor FromTorch(const torch::Tensor& tensor) {
  const auto host = tensor.detach().to(torch::kCPU).contiguous();
  HostTensor result{HostDtype(host.scalar_type()), host.sizes().vec(), {}};
  result.data.resize(host.nbytes());
  std::memcpy(result.data.data(), host.const_data_ptr(), host.nbytes());
  return result;
}

void LoadInto(torch::nn::Module& module, const LazyTensorFile& file, const std::string& source) {
  const auto targets = TensorsOf(module);
  std::map<std::string, TensorShape> expected;
  for (const auto& [name, tensor] : targets) expected[name] = tensor.sizes().vec();
  LazyTensorFile counted = file;
  std::erase_if(counted.tensors, [](const auto& item) { return item.first.ends_with("num_batches_tracked"); });
  CheckTensors(counted, expected, source);
  const torch::NoGradGuard no_gradient;
  for (const auto& [name, tensor] : targets) {
    const LazyTensor& lazy = counted.tensors.at(name);
    if (CanReferTo(lazy, tensor)) {
      CheckFinite(lazy.mapped.bytes, lazy.dtype, name, source);
      torch::Tensor(tensor).set_data(ReferTo(lazy));
      continue;
    }
    const HostTensor values = lazy.read();
    CheckFinite(values, name, source);
    torch::Tensor(tensor).copy_(ToTorch(values));
  }
}

void LoadInto(torch::nn::Module& module, const TensorFile& file, const std::string& source) {
  LoadInto(module, LazyViewOf(file), source);
}

TensorFile WeightsOf(const torch::nn::Module& module) {
  TensorFile file;
  for (const auto& [name, tensor] : TensorsOf(module)) file.tensors[name] = FromTorch(tensor);
  return file;
}

}  // namespace antipode
