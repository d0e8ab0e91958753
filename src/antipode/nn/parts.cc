#include "antipode/nn/parts.h"

#include <utility>

namespace antipode {

void RegisterAt(torch::nn::Module& root, const std::string& name,
                std::shared_ptr<torch::nn::Module> part) {
  const auto dot = name.find('.');
  if (dot == std::string::npos) {
    root.register_module(name, std::move(part));
    return;
  }
  const std::string first = name.substr(0, dot);
  const auto children = root.named_children();
  const auto* const known = children.find(first);
  const auto step =
      known ? *known : root.register_module(first, std::make_shared<torch::nn::Module>());
  RegisterAt(*step, name.substr(dot + 1), std::move(part));
}

TensorFile WithoutPrefix(const TensorFile& file, const std::string& prefix) {
  TensorFile part;
  for (const auto& [name, tensor] : file.tensors)
    if (name.starts_with(prefix)) part.tensors[name.substr(prefix.size())] = tensor;
  return part;
}

void AddWithPrefix(TensorFile& file, const TensorFile& part, const std::string& prefix) {
  for (const auto& [name, tensor] : part.tensors) file.tensors[prefix + name] = tensor;
}

}  // namespace antipode
