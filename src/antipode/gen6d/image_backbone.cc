#include "antipode/gen6d/image_backbone.h"

#include "antipode/gen6d/vgg11.h"
#include "antipode/nn/efficientnet_lite.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

using torch::Tensor;

/// Has the keys of the network inside as its own: the published checkpoints say `backbone.features.0.weight`.
class Vgg11Backbone : public ImageBackbone {
 public:
  Vgg11Backbone() {
    for (const auto& child : network_->named_children()) register_module(child.key(), child.value());
  }
  std::int64_t ChannelsAt(int stride) const override { return stride == 4 ? 256 : 512; }

 protected:
  std::vector<Tensor> Maps(const Tensor& images) override { return network_->forward(images); }
  Tensor MapAt(const std::vector<Tensor>& maps, int stride) const override {
    switch (stride) {
      case 4: return maps[2];
      case 8: return maps[3];
      case 16: return maps[4];
      default: return at::max_pool2d(maps[4], 2);
    }
  }

 private:
  Vgg11 network_;
};

class EfficientNetBackbone : public ImageBackbone {
 public:
  EfficientNetBackbone() {
    for (const auto& child : network_->named_children()) register_module(child.key(), child.value());
  }
  std::int64_t ChannelsAt(int stride) const override { return stride == 8 ? 40 : stride == 16 ? 112 : 320; }

 protected:
  std::vector<Tensor> Maps(const Tensor& images) override {
    const FeaturePyramid pyramid = network_->forward(images);
    return {pyramid.stride8, pyramid.stride16, pyramid.stride32};
  }
  Tensor MapAt(const std::vector<Tensor>& maps, int stride) const override {
    if (stride == 4) throw Error("efficientnet-lite0", "has no features at stride 4", "use strides 8, 16 and 32");
    return maps[stride == 8 ? 0 : stride == 16 ? 1 : 2];
  }

 private:
  EfficientNetLite0 network_;
};

}  // namespace

std::string NameOf(BackboneKind kind) { return kind == BackboneKind::kVgg11 ? "vgg11-bn" : "efficientnet-lite0"; }

BackboneKind BackboneKindOf(const std::string& name) {
  for (const BackboneKind kind : {BackboneKind::kVgg11, BackboneKind::kEfficientNetLite0})
    if (NameOf(kind) == name) return kind;
  throw InvalidOption("backbone", "is '" + name + "'", "use vgg11-bn or efficientnet-lite0");
}

std::shared_ptr<ImageBackbone> ImageBackbone::Make(BackboneKind kind) {
  if (kind == BackboneKind::kVgg11) return std::make_shared<Vgg11Backbone>();
  return std::make_shared<EfficientNetBackbone>();
}

std::vector<Tensor> ImageBackbone::Features(const Tensor& images, const std::vector<int>& strides) {
  const std::vector<Tensor> maps = Maps(images);
  std::vector<Tensor> features;
  for (const int stride : strides) {
    const Tensor map = MapAt(maps, stride);
    features.push_back(map / map.norm(2, 1, true).clamp_min(1e-12));
  }
  return features;
}

}  // namespace antipode
