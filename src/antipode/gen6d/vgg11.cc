#include "antipode/gen6d/vgg11.h"

#include <array>

namespace antipode {
namespace {

struct Stage {
  int convolutions, channels;
};
constexpr std::array<Stage, 5> kStages{{{1, 64}, {1, 128}, {2, 256}, {2, 512}, {2, 512}}};

torch::Tensor Normalized(const torch::Tensor& images) {
  const auto per_channel = [&](std::initializer_list<double> values) {
    return torch::tensor(std::vector<double>(values), images.options()).view({1, 3, 1, 1});
  };
  return (images - per_channel({0.485, 0.456, 0.406})) / per_channel({0.229, 0.224, 0.225});
}

}  // namespace

Vgg11Impl::Vgg11Impl() {
  int inputs = 3;
  for (const Stage& stage : kStages) {
    if (!features_->is_empty()) features_->push_back(torch::nn::MaxPool2d(2));
    for (int i = 0; i < stage.convolutions; ++i) {
      features_->push_back(torch::nn::Conv2d(torch::nn::Conv2dOptions(inputs, stage.channels, 3).padding(1)));
      features_->push_back(torch::nn::BatchNorm2d(stage.channels));
      features_->push_back(torch::nn::ReLU());
      inputs = stage.channels;
    }
  }
  register_module("features", features_);
  eval();
}

std::vector<torch::Tensor> Vgg11Impl::forward(const torch::Tensor& images) {
  std::vector<torch::Tensor> stages;
  torch::Tensor x = Normalized(images);
  const std::size_t last_relu = features_->size() - 1;
  for (std::size_t i = 0; i < last_relu; ++i) {
    auto layer = features_->children()[i];
    if (auto* pool = layer->as<torch::nn::MaxPool2d>()) {
      stages.push_back(x);
      x = pool->forward(x);
    } else if (auto* convolution = layer->as<torch::nn::Conv2d>()) {
      x = convolution->forward(x);
    } else if (auto* norm = layer->as<torch::nn::BatchNorm2d>()) {
      x = torch::batch_norm(x, norm->weight, norm->bias, norm->running_mean, norm->running_var, /*training=*/false, 0,
                            norm->options.eps(), false);
    } else {
      x = torch::relu(x);
    }
  }
  stages.push_back(x);
  return stages;
}

}  // namespace antipode
