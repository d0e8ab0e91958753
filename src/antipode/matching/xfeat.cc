#include "antipode/matching/xfeat.h"

#include <algorithm>

#include <opencv2/imgproc.hpp>

#include "antipode/matching/network_input.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

namespace functional = torch::nn::functional;

constexpr double kBatchNormEpsilon = 1e-5;
constexpr double kImageNormEpsilon = 1e-5;
constexpr int kCell = 8;
constexpr int kSizeMultiple = 32;
constexpr int kDescriptorSize = 64;
constexpr int kMaximumRadius = 2;
constexpr double kSmallScale = 0.6, kLargeScale = 1.3, kSmallScaleShare = 0.2;

torch::nn::Conv2dOptions Kernel3(int in_channels, int out_channels, int stride = 1) {
  return torch::nn::Conv2dOptions(in_channels, out_channels, 3)
      .stride(stride)
      .padding(1)
      .bias(false);
}

torch::nn::Conv2dOptions Kernel1(int in_channels, int out_channels) {
  return torch::nn::Conv2dOptions(in_channels, out_channels, 1).bias(false);
}

torch::Tensor Convolve(const torch::nn::Conv2d& conv, const torch::Tensor& x) {
  return at::conv2d(x, conv->weight, conv->bias);
}

torch::Tensor Apply(const std::vector<ConvNorm>& block, torch::Tensor x) {
  for (const ConvNorm& layer : block) x = layer(x).relu_();
  return x;
}

torch::Tensor ResizeLike(const torch::Tensor& x, const torch::Tensor& target) {
  return at::upsample_bilinear2d(x, {target.size(2), target.size(3)}, false);
}

/// Grey levels in 0..1, [1, 1, H, W].
torch::Tensor GreyImage(const cv::Mat& image) {
  cv::Mat colors;
  image.convertTo(colors, CV_32F, 1.0 / (3 * 255));
  auto grey = torch::empty({1, 1, image.rows, image.cols});
  cv::Mat target(image.size(), CV_32FC1, grey.data_ptr<float>());
  cv::transform(colors, target, cv::Matx13f(1, 1, 1));
  return grey;
}

std::int64_t RoundedSide(std::int64_t side) {
  return std::max<std::int64_t>(side / kSizeMultiple, 1) * kSizeMultiple;
}

/// Sides rounded down to multiples of 32.
torch::Tensor RoundSize(const torch::Tensor& grey) {
  const std::int64_t height = RoundedSide(grey.size(2)), width = RoundedSide(grey.size(3));
  if (height == grey.size(2) && width == grey.size(3)) return grey;
  return at::upsample_bilinear2d(grey, {height, width}, false);
}

/// The probability that a pixel is a keypoint, [H, W] on the CPU.
torch::Tensor KeypointProbability(const torch::Tensor& logits) {
  const auto cells = at::softmax(logits, 1).narrow(1, 0, kCell * kCell);
  return at::pixel_shuffle(cells, kCell)[0][0].to(torch::kCPU).contiguous();
}

/// Keypoints as row and column of each, and their probabilities.
struct Candidates {
  std::vector<float> x, y, probability;
};

bool IsLocalMaximum(const float* heat, int width, int height, int x, int y) {
  const float value = heat[y * width + x];
  const int left = std::max(0, x - kMaximumRadius), right = std::min(width - 1, x + kMaximumRadius);
  const int top = std::max(0, y - kMaximumRadius),
            bottom = std::min(height - 1, y + kMaximumRadius);
  for (int row = top; row <= bottom; ++row)
    for (int column = left; column <= right; ++column)
      if (heat[row * width + column] > value) return false;
  return true;
}

/// The published code gives score 0 to keypoints in the last row and column.
Candidates FindMaxima(const torch::Tensor& probability, double threshold) {
  const float* heat = probability.const_data_ptr<float>();
  const int height = static_cast<int>(probability.size(0)),
            width = static_cast<int>(probability.size(1));
  const auto limit = static_cast<float>(threshold);
  Candidates found;
  for (int y = 0; y < height - 1; ++y) {
    for (int x = 0; x < width - 1; ++x) {
      const float value = heat[y * width + x];
      if (!(value > limit) || !IsLocalMaximum(heat, width, height, x, y)) continue;
      found.x.push_back(static_cast<float>(x));
      found.y.push_back(static_cast<float>(y));
      found.probability.push_back(value);
    }
  }
  return found;
}

torch::Tensor ToTensor(const std::vector<float>& values, torch::Device device) {
  return torch::tensor(values, torch::kFloat).to(device);
}

enum class Interpolation { kBilinear = 0, kBicubic = 2 };

/// [1, C, h, w] at the pixels [N, 2] of the image to [N, C]. The scale is the published one, which
/// stretches the distance between the first and the last pixel centre over the whole map.
torch::Tensor SampleMap(const torch::Tensor& map, const torch::Tensor& pixels, Interpolation mode) {
  const auto last =
      torch::tensor({map.size(3) * kCell - 1, map.size(2) * kCell - 1}, pixels.options());
  const auto grid = (pixels / last * 2 - 1).view({1, -1, 1, 2});
  const auto sampled = at::grid_sampler(map, grid, static_cast<int>(mode), 0, false);
  return sampled.squeeze(3).squeeze(0).t();
}

torch::Tensor Normalized(const torch::Tensor& x, int axis) {
  return functional::normalize(x, functional::NormalizeFuncOptions().dim(axis));
}

cv::Size SizeOf(const torch::Tensor& image) {
  return {static_cast<int>(image.size(3)), static_cast<int>(image.size(2))};
}

torch::Tensor SideLengths(const torch::Tensor& image) {
  return torch::tensor({static_cast<float>(image.size(3)), static_cast<float>(image.size(2))},
                       image.options());
}

torch::Tensor Rescale(const torch::Tensor& image, double scale) {
  const auto scaled = [&](int axis) {
    return std::max<std::int64_t>(
        1, static_cast<std::int64_t>(static_cast<double>(image.size(axis)) * scale));
  };
  return at::upsample_bilinear2d(image, {scaled(2), scaled(3)}, false, scale, scale);
}

/// Upper left pixel of every cell, row by row: [h w, 2].
torch::Tensor CellCorners(std::int64_t rows, std::int64_t columns) {
  const auto x = (torch::arange(columns) * kCell).repeat({rows});
  const auto y = (torch::arange(rows) * kCell).repeat_interleave(columns);
  return torch::stack({x, y}, 1).to(torch::kFloat);
}

}  // namespace

XFeatNetworkImpl::XFeatNetworkImpl() {
  skip_ = Convolution("skip1.1", 1, 24);
  Append(block1_, "block1.0", Kernel3(1, 4));
  Append(block1_, "block1.1", Kernel3(4, 8, 2));
  Append(block1_, "block1.2", Kernel3(8, 8));
  Append(block1_, "block1.3", Kernel3(8, 24, 2));
  Append(block2_, "block2.0", Kernel3(24, 24));
  Append(block2_, "block2.1", Kernel3(24, 24));
  Append(block3_, "block3.0", Kernel3(24, 64, 2));
  Append(block3_, "block3.1", Kernel3(64, 64));
  Append(block3_, "block3.2", Kernel1(64, 64));
  Append(block4_, "block4.0", Kernel3(64, 64, 2));
  Append(block4_, "block4.1", Kernel3(64, 64));
  Append(block4_, "block4.2", Kernel3(64, 64));
  Append(block5_, "block5.0", Kernel3(64, 128, 2));
  Append(block5_, "block5.1", Kernel3(128, 128));
  Append(block5_, "block5.2", Kernel3(128, 128));
  Append(block5_, "block5.3", Kernel1(128, 64));
  Append(fusion_block_, "block_fusion.0", Kernel3(64, 64));
  Append(fusion_block_, "block_fusion.1", Kernel3(64, 64));
  fusion_ = Convolution("block_fusion.2", 64, kDescriptorSize);
  Append(reliability_block_, "heatmap_head.0", Kernel1(64, 64));
  Append(reliability_block_, "heatmap_head.1", Kernel1(64, 64));
  reliability_ = Convolution("heatmap_head.2", 64, 1);
  Append(keypoint_block_, "keypoint_head.0", Kernel1(64, 64));
  Append(keypoint_block_, "keypoint_head.1", Kernel1(64, 64));
  Append(keypoint_block_, "keypoint_head.2", Kernel1(64, 64));
  keypoints_ = Convolution("keypoint_head.3", 64, kCell * kCell + 1);
  const int sizes[] = {2 * kDescriptorSize, 512, 512, 512, 512, kCell * kCell};
  for (int i = 0; i < 5; ++i) {
    refinement_.emplace_back(sizes[i], sizes[i + 1]);
    RegisterAt(*this, "fine_matcher." + std::to_string(3 * i), refinement_.back().ptr());
    if (i == 4) break;
    refinement_norms_.emplace_back(torch::nn::BatchNorm1dOptions(sizes[i + 1]).affine(false));
    RegisterAt(*this, "fine_matcher." + std::to_string(3 * i + 1), refinement_norms_.back().ptr());
  }
}

void XFeatNetworkImpl::Append(Block& block, const std::string& name,
                              torch::nn::Conv2dOptions options) {
  const auto channels = options.out_channels();
  block.push_back({torch::nn::Conv2d(options),
                   torch::nn::BatchNorm2d(torch::nn::BatchNorm2dOptions(channels).affine(false)),
                   {}});
  RegisterAt(*this, name + ".layer.0", block.back().conv.ptr());
  RegisterAt(*this, name + ".layer.1", block.back().norm.ptr());
}

torch::nn::Conv2d XFeatNetworkImpl::Convolution(const std::string& name, int in_channels,
                                                int out_channels) {
  torch::nn::Conv2d conv(Kernel1(in_channels, out_channels).bias(true));
  RegisterAt(*this, name, conv.ptr());
  return conv;
}

XFeatMaps XFeatNetworkImpl::forward(const torch::Tensor& grey) const {
  const auto image = at::instance_norm(grey, {}, {}, {}, {}, true, 0, kImageNormEpsilon, false);
  const auto skip = Convolve(skip_, at::avg_pool2d(image, 4, 4));
  const auto x2 = Apply(block2_, Apply(block1_, image) + skip);
  const auto x3 = Apply(block3_, x2);
  const auto x4 = Apply(block4_, x3);
  const auto x5 = Apply(block5_, x4);
  const auto pyramid = x3 + ResizeLike(x4, x3) + ResizeLike(x5, x3);
  XFeatMaps maps;
  maps.descriptors = Convolve(fusion_, Apply(fusion_block_, pyramid));
  maps.reliability = Convolve(reliability_, Apply(reliability_block_, maps.descriptors)).sigmoid_();
  maps.keypoint_logits =
      Convolve(keypoints_, Apply(keypoint_block_, at::pixel_unshuffle(image, kCell)));
  return maps;
}

torch::Tensor XFeatNetworkImpl::RefinementLogits(const torch::Tensor& reference,
                                                 const torch::Tensor& query) const {
  torch::Tensor x = torch::cat({reference, query}, 1);
  for (std::size_t i = 0; i < refinement_.size(); ++i) {
    x = at::linear(x, refinement_[i]->weight, refinement_[i]->bias);
    if (i == refinement_norms_.size()) break;
    const auto& norm = *refinement_norms_[i];
    x = ((x - norm.running_mean) * torch::rsqrt(norm.running_var + kBatchNormEpsilon)).relu_();
  }
  return x;
}

void XFeatNetworkImpl::Prepare() {
  for (Block* const block : {&block1_, &block2_, &block3_, &block4_, &block5_, &fusion_block_,
                             &reliability_block_, &keypoint_block_})
    for (ConvNorm& layer : *block) layer.Prepare();
}

void XFeatOptions::Check() const {
  if (top_k < 1) throw InvalidOption("top_k", "is not positive", "allow at least one feature");
  if (!(detection_threshold >= 0 && detection_threshold < 1))
    throw InvalidOption("detection_threshold", "is not a probability", "use a number from 0 to 1");
  if (max_side < kSizeMultiple) throw InvalidOption("max_side", "is below 32 pixels", "use 640");
}

XFeat::XFeat(const TensorFile& weights, const std::string& source, const XFeatOptions& options,
             torch::Device device)
    : options_(options), device_(device) {
  options_.Check();
  LoadInto(*network_, weights, source);
  network_->to(device_);
  network_->Prepare();
}

LocalFeatures XFeat::Detect(const cv::Mat& image) const {
  const torch::InferenceMode inference;
  if (HasNothingToSee(image)) return LocalFeatures::None(kDescriptorSize, image.size());
  const auto grey = RoundSize(GreyImage(LimitSide(image, options_.max_side))).to(device_);
  const XFeatMaps maps = network_->forward(grey);
  const Candidates found =
      FindMaxima(KeypointProbability(maps.keypoint_logits), options_.detection_threshold);
  if (found.x.empty()) return LocalFeatures::None(kDescriptorSize, image.size());

  torch::Tensor pixels = torch::stack({ToTensor(found.x, device_), ToTensor(found.y, device_)}, 1);
  const auto reliability = SampleMap(maps.reliability, pixels, Interpolation::kBilinear).squeeze(1);
  const auto [scores, best] = torch::topk(ToTensor(found.probability, device_) * reliability,
                                          std::min<std::int64_t>(options_.top_k, pixels.size(0)));
  pixels = pixels.index_select(0, best);
  const auto descriptors =
      SampleMap(Normalized(maps.descriptors, 1), pixels, Interpolation::kBicubic);
  return {ToImagePixels(pixels, SizeOf(grey), image.size()), Normalized(descriptors, 1), scores,
          image.size()};
}

SemiDenseFeatures XFeat::DetectSemiDense(const cv::Mat& image) const {
  const torch::InferenceMode inference;
  if (HasNothingToSee(image))
    return {LocalFeatures::None(kDescriptorSize, image.size()), torch::empty({0})};
  const auto grey = GreyImage(LimitSide(image, options_.max_side)).to(device_);
  const SemiDenseFeatures small = DetectCells(grey, kSmallScale, kSmallScaleShare);
  const SemiDenseFeatures large = DetectCells(grey, kLargeScale, 1 - kSmallScaleShare);
  const auto join = [&](auto member) {
    return torch::cat({small.features.*member, large.features.*member});
  };
  const auto pixels = join(&LocalFeatures::keypoints);
  const double shrunk = static_cast<double>(image.cols) / static_cast<double>(grey.size(3));
  return {{ToImagePixels(pixels, SizeOf(grey), image.size()), join(&LocalFeatures::descriptors),
           join(&LocalFeatures::scores), image.size()},
          torch::cat({small.scales, large.scales}) * shrunk};
}

SemiDenseFeatures XFeat::DetectCells(const torch::Tensor& grey, double scale, double share) const {
  const torch::Tensor scaled = Rescale(grey, scale);
  const torch::Tensor seen = RoundSize(scaled);
  const XFeatMaps maps = network_->forward(seen);
  const auto reliability = maps.reliability.flatten();
  const auto count = static_cast<std::int64_t>(options_.top_k * share);
  const auto [scores, best] = torch::topk(reliability, std::min(count, reliability.size(0)));
  const auto descriptors = maps.descriptors[0].flatten(1).t().index_select(0, best);
  const auto corners = CellCorners(maps.reliability.size(2), maps.reliability.size(3)).to(device_);
  const auto pixels =
      corners.index_select(0, best) * (SideLengths(scaled) / SideLengths(seen) / scale);
  const LocalFeatures features{pixels, descriptors, scores, SizeOf(grey)};
  return {features, torch::full_like(scores, 1 / scale)};
}

torch::Tensor XFeat::RefinementLogits(const torch::Tensor& reference,
                                      const torch::Tensor& query) const {
  const torch::InferenceMode inference;
  return network_->RefinementLogits(reference, query);
}

}  // namespace antipode
