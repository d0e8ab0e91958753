#include "antipode/nn/efficientnet_lite.h"

#include "antipode/nn/depthwise_conv.h"
#include "antipode/nn/module_weights.h"

namespace antipode {
namespace {

constexpr double kBatchNormEpsilon = 1e-3;
constexpr double kImageMean = 0.498, kImageDeviation = 0.502;
constexpr int kStride8Block = 4, kStride16Block = 10, kStride32Block = 15;

FoldedConv MakeConv(int in_channels, int out_channels, int kernel, int stride, int groups = 1) {
  return {torch::nn::Conv2d(torch::nn::Conv2dOptions(in_channels, out_channels, kernel)
                                .stride(stride)
                                .groups(groups)
                                .bias(false)),
          torch::nn::BatchNorm2d(torch::nn::BatchNorm2dOptions(out_channels).eps(kBatchNormEpsilon))};
}

void Register(torch::nn::Module& owner, const FoldedConv& part, const std::string& conv_name,
              const std::string& norm_name) {
  owner.register_module(conv_name, part.conv);
  owner.register_module(norm_name, part.norm);
}

struct Stage {
  int channels, kernel, stride, expansion, repeats;
};
constexpr Stage kStages[] = {{16, 3, 1, 1, 1},  {24, 3, 2, 6, 2},  {40, 5, 2, 6, 2}, {80, 3, 2, 6, 3},
                             {112, 5, 1, 6, 3}, {192, 5, 2, 6, 4}, {320, 3, 1, 6, 1}};

}  // namespace

torch::Tensor FoldedConv::operator()(const torch::Tensor& x) const {
  torch::Tensor weight = conv->weight, bias = norm->bias;
  if (!absorbed) {
    const auto scale = norm->weight * torch::rsqrt(norm->running_var + kBatchNormEpsilon);
    weight = weight * scale.view({-1, 1, 1, 1});
    bias = bias - norm->running_mean * scale;
  }
  const int kernel = static_cast<int>(conv->weight.size(2));
  const int stride = static_cast<int>(conv->options.stride()->at(0));
  const auto groups = conv->options.groups();
  int padding = kernel / 2;
  torch::Tensor padded = x;
  if (stride == 2) {
    const int total = kernel - 2;  // for even sizes
    padded = torch::constant_pad_nd(x, {total / 2, total - total / 2, total / 2, total - total / 2});
    padding = 0;
  }
  if (groups > 1) return DepthwiseConv2d(padded, weight, bias, stride, padding);
  return at::conv2d(padded, weight, bias, stride, padding);
}

void FoldedConv::AbsorbNormalization() {
  const torch::NoGradGuard no_gradient;
  const auto scale = norm->weight * torch::rsqrt(norm->running_var + kBatchNormEpsilon);
  conv->weight.mul_(scale.view({-1, 1, 1, 1}));
  norm->bias.sub_(norm->running_mean * scale);
  norm->weight.fill_(1);
  norm->running_mean.zero_();
  norm->running_var.fill_(1 - kBatchNormEpsilon);
  absorbed = true;
}

MobileInvertedBlockImpl::MobileInvertedBlockImpl(int in_channels, int out_channels, int kernel,
                                                 int stride, int expansion)
    : residual_(stride == 1 && in_channels == out_channels) {
  const int middle = in_channels * expansion;
  if (expansion != 1) {
    expand_ = MakeConv(in_channels, middle, 1, 1);
    Register(*this, expand_, "_expand_conv", "_bn0");
  }
  depthwise_ = MakeConv(middle, middle, kernel, stride, middle);
  Register(*this, depthwise_, "_depthwise_conv", "_bn1");
  project_ = MakeConv(middle, out_channels, 1, 1);
  Register(*this, project_, "_project_conv", "_bn2");
}

torch::Tensor MobileInvertedBlockImpl::forward(torch::Tensor x) {
  const auto input = x;
  if (expand_.conv) x = torch::relu6(expand_(x));
  x = torch::relu6(depthwise_(x));
  x = project_(x);
  return residual_ ? x + input : x;
}

void MobileInvertedBlockImpl::AbsorbNormalization() {
  if (expand_.conv) expand_.AbsorbNormalization();
  depthwise_.AbsorbNormalization();
  project_.AbsorbNormalization();
}

EfficientNetLite0Impl::EfficientNetLite0Impl() {
  stem_ = MakeConv(3, 32, 3, 2);
  Register(*this, stem_, "_conv_stem", "_bn0");
  int channels = 32;
  for (const Stage& stage : kStages) {
    for (int i = 0; i < stage.repeats; ++i) {
      blocks_->push_back(MobileInvertedBlock(channels, stage.channels, stage.kernel,
                                             i == 0 ? stage.stride : 1, stage.expansion));
      channels = stage.channels;
    }
  }
  register_module("_blocks", blocks_);
}

FeaturePyramid EfficientNetLite0Impl::forward(const torch::Tensor& images) {
  FeaturePyramid pyramid;
  torch::Tensor x = ((images - kImageMean) / kImageDeviation).contiguous(torch::MemoryFormat::ChannelsLast);
  {
    const torch::AutoGradMode gradient(torch::GradMode::is_enabled() && frozen_blocks_ == 0);
    x = torch::relu6(stem_(x));
  }
  for (int i = 0; i <= kStride32Block; ++i) {
    const torch::AutoGradMode gradient(torch::GradMode::is_enabled() && i >= frozen_blocks_);
    x = blocks_[i]->as<MobileInvertedBlock>()->forward(x);
    if (i == kStride8Block) pyramid.stride8 = x;
    if (i == kStride16Block) pyramid.stride16 = x;
  }
  pyramid.stride32 = x;
  return pyramid;
}

void EfficientNetLite0Impl::FreezeFirstBlocks(int count) {
  frozen_blocks_ = count;
  for (auto& parameter : stem_.conv->parameters()) parameter.set_requires_grad(count == 0);
  for (auto& parameter : stem_.norm->parameters()) parameter.set_requires_grad(count == 0);
  for (std::size_t i = 0; i < blocks_->size(); ++i)
    for (auto& parameter : blocks_[i]->parameters())
      parameter.set_requires_grad(static_cast<int>(i) >= count);
}

void EfficientNetLite0Impl::AbsorbNormalization() {
  stem_.AbsorbNormalization();
  for (const auto& block : *blocks_) block->as<MobileInvertedBlock>()->AbsorbNormalization();
}

TensorFile EfficientNetLite0Weights(TensorFile checkpoint, const std::string& source) {
  std::erase_if(checkpoint.tensors, [](const auto& item) {
    const std::string& name = item.first;
    return name.starts_with("_conv_head.") || name.starts_with("_bn1.") || name.starts_with("_fc.");
  });
  EfficientNetLite0 network;
  LoadInto(*network, checkpoint, source);
  return WeightsOf(*network);
}

}  // namespace antipode
