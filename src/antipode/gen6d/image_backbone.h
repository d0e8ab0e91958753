#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <torch/torch.h>

namespace antipode {

/// Which network turns an image into feature maps.
enum class BackboneKind {
  kVgg11,             ///< the published networks'
  kEfficientNetLite0, ///< a twentieth of the work; the built-in models'
};

std::string NameOf(BackboneKind kind);               ///< "vgg11-bn", "efficientnet-lite0"
BackboneKind BackboneKindOf(const std::string& name);  ///< @throws InvalidOption

/// Feature maps of an image at a choice of strides, every pixel's feature of length 1. The network inside is a
/// submodule that holds the keys as its checkpoint names them.
class ImageBackbone : public torch::nn::Module {
 public:
  static std::shared_ptr<ImageBackbone> Make(BackboneKind kind);

  /// @param images [B, 3, H, W], RGB in [0, 1]
  /// @param strides of 4, 8, 16 and 32; EfficientNet-Lite0 has none at 4
  /// @return [B, ChannelsAt(stride), H / stride, W / stride] each, L2-normalised over channels
  std::vector<torch::Tensor> Features(const torch::Tensor& images, const std::vector<int>& strides);
  virtual std::int64_t ChannelsAt(int stride) const = 0;

 protected:
  virtual torch::Tensor MapAt(const std::vector<torch::Tensor>& maps, int stride) const = 0;
  virtual std::vector<torch::Tensor> Maps(const torch::Tensor& images) = 0;
};

}  // namespace antipode
