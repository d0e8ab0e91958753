#include "antipode/weights/tensor_hash.h"

#include <span>

#include "antipode/util/files.h"

namespace antipode {

std::string Sha256OfTensors(const TensorFile& file) {
  std::string text;
  for (const auto& [name, tensor] : file.tensors) text += name + Sha256Hex(std::span<const std::byte>(tensor.data));
  return Sha256Hex(std::as_bytes(std::span(text)));
}

}  // namespace antipode
