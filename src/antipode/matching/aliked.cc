#include "antipode/matching/aliked.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <opencv2/imgproc.hpp>

#include "antipode/matching/network_input.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

namespace functional = torch::nn::functional;

constexpr int kSizeMultiple = 32;
constexpr int kDescriptorSize = 128;
constexpr int kPlaces = 16;
constexpr int kMaximumRadius = 2;
constexpr int kMaximumSide = 2 * kMaximumRadius + 1;
constexpr float kSoftArgmaxTemperature = 0.1f;

torch::nn::Conv2dOptions Kernel(int size, int in_channels, int out_channels) {
  return torch::nn::Conv2dOptions(in_channels, out_channels, size).padding(size / 2).bias(false);
}

torch::Tensor Convolve(const torch::nn::Conv2d& conv, const torch::Tensor& x) {
  return at::conv2d(x, conv->weight, conv->bias, 1, conv->options.kernel_size()->at(0) / 2);
}

/// Two normalised convolutions, the second one added to the shortcut if there is one.
template <typename Block>
torch::Tensor Apply(const Block& block, const torch::Tensor& x) {
  auto first = block.first(x);
  auto second = block.second(at::selu_(first));
  if (block.shortcut) second += Convolve(block.shortcut, x);
  return at::selu_(second);
}

/// The image repeated beyond its borders to sides that are multiples of 32.
struct PaddedImage {
  cv::Mat image;
  cv::Rect inside;  ///< where the image itself lies
};

PaddedImage PadImage(const cv::Mat& image) {
  const auto missing = [](int side) {
    return (kSizeMultiple - side % kSizeMultiple) % kSizeMultiple;
  };
  const int columns = missing(image.cols), rows = missing(image.rows);
  PaddedImage padded;
  padded.inside = {columns / 2, rows / 2, image.cols, image.rows};
  cv::copyMakeBorder(image, padded.image, rows / 2, rows - rows / 2, columns / 2,
                     columns - columns / 2, cv::BORDER_REPLICATE);
  return padded;
}

/// [1, 3, H, W] in 0..1, the three colours of a pixel next to each other in memory.
torch::Tensor ToNetworkInput(const cv::Mat& image) {
  auto colors = torch::empty({1, image.rows, image.cols, 3});
  cv::Mat target(image.size(), CV_32FC3, colors.data_ptr<float>());
  image.convertTo(target, CV_32F, 1.0 / 255);
  return colors.permute({0, 3, 1, 2});
}

cv::Mat LargestAround(const cv::Mat& values) {
  static const cv::Mat kSquare =
      cv::getStructuringElement(cv::MORPH_RECT, {kMaximumSide, kMaximumSide});
  cv::Mat largest;
  cv::dilate(values, largest, kSquare);
  return largest;
}

/// 255 where a score is the largest around; then twice more among the pixels that no maximum is
/// near.
cv::Mat FindMaxima(const cv::Mat& scores) {
  cv::Mat maxima = scores == LargestAround(scores);
  for (int i = 0; i < 2; ++i) {
    const cv::Mat taken = LargestAround(maxima);
    cv::Mat rest = scores.clone();
    rest.setTo(0, taken);
    maxima |= (rest == LargestAround(rest)) & ~taken;
  }
  return maxima;
}

/// The maxima away from the border that exceed the threshold, or the mean score if none does; best
/// first.
std::vector<cv::Point> FindKeypoints(const cv::Mat& scores, const AlikedOptions& options) {
  const cv::Rect inner(kMaximumRadius, kMaximumRadius, scores.cols - 2 * kMaximumRadius,
                       scores.rows - 2 * kMaximumRadius);
  const cv::Mat maxima = FindMaxima(scores)(inner);
  const cv::Mat inner_scores = scores(inner);
  const auto above = [&](double threshold) {
    const cv::Mat good = maxima & (inner_scores > threshold);
    std::vector<cv::Point> points;
    cv::findNonZero(good, points);
    for (cv::Point& point : points) point += inner.tl();
    return points;
  };
  std::vector<cv::Point> points = above(options.detection_threshold);
  if (points.empty()) points = above(cv::mean(scores)[0]);
  std::ranges::stable_sort(points, std::greater{},
                           [&](const cv::Point& point) { return scores.at<float>(point); });
  points.resize(std::min<std::size_t>(points.size(), options.top_k));
  return points;
}

/// The mean place of the 5 x 5 pixels around a maximum, weighted by exp(score / 0.1).
cv::Point2f Refine(const cv::Mat& scores, cv::Point maximum) {
  const cv::Rect around(maximum.x - kMaximumRadius, maximum.y - kMaximumRadius, kMaximumSide,
                        kMaximumSide);
  double largest = 0;
  cv::minMaxLoc(scores(around), nullptr, &largest);
  float sum = 0, x = 0, y = 0;
  for (int row = -kMaximumRadius; row <= kMaximumRadius; ++row) {
    for (int column = -kMaximumRadius; column <= kMaximumRadius; ++column) {
      const float score = scores.at<float>(maximum.y + row, maximum.x + column);
      const float weight = std::exp((score - static_cast<float>(largest)) / kSoftArgmaxTemperature);
      sum += weight;
      x += weight * static_cast<float>(column);
      y += weight * static_cast<float>(row);
    }
  }
  return {static_cast<float>(maximum.x) + x / sum, static_cast<float>(maximum.y) + y / sum};
}

torch::Tensor ToTensor(const std::vector<cv::Point2f>& points) {
  auto tensor = torch::empty({static_cast<std::int64_t>(points.size()), 2});
  std::ranges::copy(points, reinterpret_cast<cv::Point2f*>(tensor.data_ptr<float>()));
  return tensor;
}

/// The pixel in the middle of the 3 x 3 pixels that the places around a keypoint are derived from.
/// The published code keeps one column and row more than needed from the right and bottom border.
torch::Tensor PatchCentres(const torch::Tensor& keypoints, cv::Size size) {
  const auto pixels = keypoints.trunc();
  const auto limit = [&](int axis, int side) {
    return pixels.select(1, axis).clamp(1, std::max(1, side - 3));
  };
  return torch::stack({limit(0, size.width), limit(1, size.height)}, 1);
}

}  // namespace

AlikedNetworkImpl::AlikedNetworkImpl() {
  block1_ = MakePlainBlock("block1", 3, 16);
  block2_ = MakePlainBlock("block2", 16, 32);
  block3_ = MakeDeformableBlock("block3", 32, 64);
  block4_ = MakeDeformableBlock("block4", 64, 128);
  block2_.shortcut = Register("block2.downsample", Kernel(1, 16, 32).bias(true));
  block3_.shortcut = Register("block3.downsample", Kernel(1, 32, 64).bias(true));
  block4_.shortcut = Register("block4.downsample", Kernel(1, 64, 128).bias(true));
  const int level_channels[] = {16, 32, 64, 128};
  for (int i = 0; i < 4; ++i)
    level_convs_.push_back(Register("conv" + std::to_string(i + 1),
                                    Kernel(1, level_channels[i], MultiScaleFeatures::kChannels)));
  score_convs_ = {Register("score_head.0", Kernel(1, kDescriptorSize, 8)),
                  Register("score_head.2", Kernel(3, 8, 4)),
                  Register("score_head.4", Kernel(3, 4, 4)),
                  Register("score_head.6", Kernel(3, 4, 1))};
  patch_conv_ = Register("desc_head.offset_conv.0",
                         Kernel(3, kDescriptorSize, 2 * kPlaces).padding(0).bias(true));
  offset_conv_ =
      Register("desc_head.offset_conv.2", Kernel(1, 2 * kPlaces, 2 * kPlaces).bias(true));
  sample_conv_ = Register("desc_head.sf_conv", Kernel(1, kDescriptorSize, kDescriptorSize));
  place_weights_ = torch::rand({kPlaces, kDescriptorSize, kDescriptorSize});
  const auto head = named_children()["desc_head"];
  head->register_parameter("agg_weights", place_weights_);
}

torch::nn::Conv2d AlikedNetworkImpl::Register(const std::string& name,
                                              torch::nn::Conv2dOptions options) {
  torch::nn::Conv2d conv(options);
  RegisterAt(*this, name, conv.ptr());
  return conv;
}

torch::nn::BatchNorm2d AlikedNetworkImpl::RegisterNorm(const std::string& name, int channels) {
  torch::nn::BatchNorm2d norm{torch::nn::BatchNorm2dOptions(channels)};
  RegisterAt(*this, name, norm.ptr());
  return norm;
}

AlikedNetworkImpl::PlainBlock AlikedNetworkImpl::MakePlainBlock(const std::string& name,
                                                                int in_channels, int out_channels) {
  PlainBlock block;
  block.first.conv = Register(name + ".conv1", Kernel(3, in_channels, out_channels));
  block.first.norm = RegisterNorm(name + ".bn1", out_channels);
  block.second.conv = Register(name + ".conv2", Kernel(3, out_channels, out_channels));
  block.second.norm = RegisterNorm(name + ".bn2", out_channels);
  return block;
}

AlikedNetworkImpl::DeformableBlock AlikedNetworkImpl::MakeDeformableBlock(const std::string& name,
                                                                          int in_channels,
                                                                          int out_channels) {
  const auto make = [&](const std::string& number, int channels) {
    const std::string conv = name + ".conv" + number;
    return DeformableConvNorm{Register(conv + ".offset_conv", Kernel(3, channels, 18).bias(true)),
                              Register(conv + ".regular_conv", Kernel(3, channels, out_channels)),
                              RegisterNorm(name + ".bn" + number, out_channels),
                              {},
                              {}};
  };
  return {make("1", in_channels), make("2", out_channels), nullptr};
}

void AlikedNetworkImpl::Prepare() {
  for (PlainBlock* const block : {&block1_, &block2_}) {
    block->first.Prepare();
    block->second.Prepare();
  }
  for (DeformableBlock* const block : {&block3_, &block4_}) {
    block->first.Prepare();
    block->second.Prepare();
  }
}

AlikedMaps AlikedNetworkImpl::forward(const torch::Tensor& image) const {
  const auto x1 = Apply(block1_, image);
  const auto x2 = Apply(block2_, at::avg_pool2d(x1, 2, 2));
  const auto x3 = Apply(block3_, at::avg_pool2d(x2, 4, 4));
  const auto x4 = Apply(block4_, at::avg_pool2d(x3, 4, 4));
  std::vector<torch::Tensor> levels = {x1, x2, x3, x4};
  for (std::size_t i = 0; i < levels.size(); ++i) {
    levels[i] = Convolve(level_convs_[i], levels[i]);
    at::selu_(levels[i]);
  }
  AlikedMaps maps;
  maps.score = Score(levels);
  for (const torch::Tensor& level : levels) maps.levels.push_back(level[0].permute({1, 2, 0}));
  return maps;
}

/// The first convolution of the head is of single pixels, so it may come before the upsampling,
/// where there is less to do.
torch::Tensor AlikedNetworkImpl::Score(const std::vector<torch::Tensor>& levels) const {
  const auto weights = score_convs_[0]->weight.split(MultiScaleFeatures::kChannels, 1);
  torch::Tensor x = at::conv2d(levels[0], weights[0]);
  for (std::size_t i = 1; i < levels.size(); ++i)
    x += at::upsample_bilinear2d(at::conv2d(levels[i], weights[i]), {x.size(2), x.size(3)}, true);
  for (std::size_t i = 1; i < score_convs_.size(); ++i) x = Convolve(score_convs_[i], at::selu_(x));
  return x.sigmoid_()[0][0];
}

torch::Tensor AlikedNetworkImpl::Describe(const MultiScaleFeatures& features,
                                          const torch::Tensor& keypoints, cv::Size size) const {
  const std::int64_t count = keypoints.size(0);
  const auto steps = torch::arange(-1, 2, keypoints.options());
  const auto patch = torch::stack({steps.repeat({3}), steps.repeat_interleave(3)}, 1);
  const auto pixels = PatchCentres(keypoints, size).unsqueeze(1) + patch;
  const auto around = features.SampleBilinear(pixels.view({-1, 2})).view({count, -1});
  const auto patch_weight = patch_conv_->weight.permute({0, 2, 3, 1}).reshape({2 * kPlaces, -1});
  auto hidden = at::linear(around, patch_weight, patch_conv_->bias);
  const double limit = std::max(size.width, size.height) / 4.0;
  const auto offsets =
      at::linear(at::selu_(hidden), offset_conv_->weight.flatten(1), offset_conv_->bias)
          .clamp_(-limit, limit)
          .view({count, 2, kPlaces})
          .transpose(1, 2);
  const auto places = (keypoints.unsqueeze(1) + offsets).reshape({-1, 2});
  auto samples = at::linear(features.SampleBilinear(places), sample_conv_->weight.flatten(1));
  const auto descriptors =
      torch::mm(at::selu_(samples).view({count, -1}), place_weights_.flatten(0, 1));
  return functional::normalize(descriptors, functional::NormalizeFuncOptions().dim(1));
}

void AlikedOptions::Check() const {
  if (top_k < 1) throw InvalidOption("top_k", "is not positive", "allow at least one feature");
  if (!(detection_threshold > 0 && detection_threshold < 1))
    throw InvalidOption("detection_threshold", "is not between 0 and 1", "use 0.2");
  if (max_side < kSizeMultiple) throw InvalidOption("max_side", "is below 32 pixels", "use 640");
}

Aliked::Aliked(const TensorFile& weights, const std::string& source, const AlikedOptions& options,
               torch::Device device)
    : options_(options), device_(device) {
  options_.Check();
  LoadInto(*network_, weights, source);
  network_->to(device_);
  network_->Prepare();
}

LocalFeatures Aliked::Detect(const cv::Mat& image) const {
  const torch::InferenceMode inference;
  const auto none = LocalFeatures::None(kDescriptorSize, image.size());
  if (HasNothingToSee(image)) return none;
  const PaddedImage padded = PadImage(LimitSide(image, options_.max_side));
  const AlikedMaps maps = network_->forward(ToNetworkInput(padded.image).to(device_));
  const auto scores = maps.score.to(torch::kCPU).contiguous();
  const cv::Mat all_scores(padded.image.size(), CV_32FC1, scores.data_ptr<float>());
  const cv::Mat seen_scores = all_scores(padded.inside).clone();
  const std::vector<cv::Point> maxima = FindKeypoints(seen_scores, options_);
  if (maxima.empty()) return none;

  std::vector<cv::Point2f> refined;
  std::vector<float> best;
  for (const cv::Point& maximum : maxima) {
    refined.push_back(Refine(seen_scores, maximum));
    best.push_back(seen_scores.at<float>(maximum));
  }
  const auto keypoints = ToTensor(refined).to(device_);
  const MultiScaleFeatures features(maps.levels, padded.inside);
  return {ToImagePixels(keypoints, padded.inside.size(), image.size()),
          network_->Describe(features, keypoints, padded.inside.size()),
          torch::tensor(best).to(device_), image.size()};
}

}  // namespace antipode
