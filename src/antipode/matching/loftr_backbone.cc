#include "antipode/matching/loftr_backbone.h"

namespace antipode {
namespace {

constexpr double kBatchNormEpsilon = 1e-5;
constexpr double kLeak = 0.01;
constexpr int kChannels2 = 128, kChannels4 = 196, kChannels8 = 256;

torch::nn::Conv2d MakeConv(int in_channels, int out_channels, int kernel, int stride = 1) {
  return torch::nn::Conv2d(torch::nn::Conv2dOptions(in_channels, out_channels, kernel)
                               .stride(stride)
                               .padding(kernel / 2)
                               .bias(false));
}

NormalizedConv MakeNormalizedConv(int in_channels, int out_channels, int kernel, int stride = 1) {
  return {
      MakeConv(in_channels, out_channels, kernel, stride),
      torch::nn::BatchNorm2d(torch::nn::BatchNorm2dOptions(out_channels).eps(kBatchNormEpsilon))};
}

torch::Tensor Convolve(const torch::nn::Conv2d& conv, const torch::Tensor& x) {
  return at::conv2d(x, conv->weight, {}, *conv->options.stride(), conv->weight.size(2) / 2);
}

torch::Tensor TwiceAsLarge(const torch::Tensor& x) {
  constexpr bool kAlignCorners = true;
  return at::upsample_bilinear2d(x, {2 * x.size(2), 2 * x.size(3)}, kAlignCorners);
}

torch::Tensor Through(const std::vector<LoftrResidualBlock>& blocks, torch::Tensor x) {
  for (const LoftrResidualBlock& block : blocks) x = block->forward(x);
  return x;
}

}  // namespace

torch::Tensor NormalizedConv::operator()(const torch::Tensor& x) const {
  const auto scale = norm->weight * torch::rsqrt(norm->running_var + kBatchNormEpsilon);
  return at::conv2d(x, conv->weight * scale.view({-1, 1, 1, 1}),
                    norm->bias - norm->running_mean * scale, *conv->options.stride(),
                    conv->weight.size(2) / 2);
}

LoftrResidualBlockImpl::LoftrResidualBlockImpl(int in_channels, int out_channels, int stride)
    : first_(MakeNormalizedConv(in_channels, out_channels, 3, stride)),
      second_(MakeNormalizedConv(out_channels, out_channels, 3)) {
  register_module("conv1", first_.conv);
  register_module("bn1", first_.norm);
  register_module("conv2", second_.conv);
  register_module("bn2", second_.norm);
  if (stride == 1) return;
  shortcut_ = MakeNormalizedConv(in_channels, out_channels, 1, stride);
  register_module("downsample", torch::nn::ModuleList(shortcut_.conv, shortcut_.norm));
}

torch::Tensor LoftrResidualBlockImpl::forward(const torch::Tensor& x) const {
  auto y = second_(first_(x).relu_());
  return y.add_(shortcut_.conv ? shortcut_(x) : x).relu_();
}

torch::Tensor LoftrBackboneImpl::Smoothing::operator()(const torch::Tensor& x) const {
  auto y = first(x);
  return Convolve(second, at::leaky_relu_(y, kLeak));
}

LoftrBackboneImpl::LoftrBackboneImpl()
    : stem_(MakeNormalizedConv(1, kChannels2, 7, 2)),
      lateral2_(MakeConv(kChannels2, kChannels4, 1)),
      lateral4_(MakeConv(kChannels4, kChannels8, 1)),
      lateral8_(MakeConv(kChannels8, kChannels8, 1)) {
  register_module("conv1", stem_.conv);
  register_module("bn1", stem_.norm);
  stride2_ = AddBlocks("layer1", kChannels2, kChannels2, 1);
  stride4_ = AddBlocks("layer2", kChannels2, kChannels4, 2);
  stride8_ = AddBlocks("layer3", kChannels4, kChannels8, 2);
  register_module("layer3_outconv", lateral8_);
  register_module("layer2_outconv", lateral4_);
  register_module("layer1_outconv", lateral2_);
  smoothing4_ = AddSmoothing("layer2_outconv2", kChannels8, kChannels4);
  smoothing2_ = AddSmoothing("layer1_outconv2", kChannels4, kChannels2);
}

LoftrBackboneImpl::Blocks LoftrBackboneImpl::AddBlocks(const std::string& name, int in_channels,
                                                       int out_channels, int stride) {
  Blocks blocks = {LoftrResidualBlock(in_channels, out_channels, stride),
                   LoftrResidualBlock(out_channels, out_channels, 1)};
  register_module(name, torch::nn::ModuleList(blocks[0], blocks[1]));
  return blocks;
}

LoftrBackboneImpl::Smoothing LoftrBackboneImpl::AddSmoothing(const std::string& name,
                                                             int in_channels, int out_channels) {
  Smoothing smoothing{MakeNormalizedConv(in_channels, in_channels, 3),
                      MakeConv(in_channels, out_channels, 3)};
  register_module(name, torch::nn::ModuleList(smoothing.first.conv, smoothing.first.norm,
                                              torch::nn::LeakyReLU(), smoothing.second));
  return smoothing;
}

LoftrFeatures LoftrBackboneImpl::forward(const torch::Tensor& image) const {
  // Channels last halves the time; with its single channel the image itself cannot tell its layout.
  const auto stem = stem_(image).relu_().contiguous(torch::MemoryFormat::ChannelsLast);
  const auto half = Through(stride2_, stem);
  const auto quarter = Through(stride4_, half);
  const auto coarse = Convolve(lateral8_, Through(stride8_, quarter));
  const auto middle = smoothing4_(Convolve(lateral4_, quarter).add_(TwiceAsLarge(coarse)));
  return {coarse, smoothing2_(Convolve(lateral2_, half).add_(TwiceAsLarge(middle)))};
}

}  // namespace antipode
