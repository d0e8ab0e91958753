#include "antipode/zero123/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <opencv2/imgproc.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kChannels = 3;
constexpr double kLanczosWidth = 3;
constexpr int kWeightBits = 22;
constexpr int kNearWhite = 250;  // lighter pixels are background

double Lanczos(double x) {
  if (x == 0) return 1;
  if (std::abs(x) >= kLanczosWidth) return 0;
  const double angle = std::numbers::pi * x;
  return std::sin(angle) / angle * std::sin(angle / kLanczosWidth) / (angle / kLanczosWidth);
}

/// The integer weights of the source pixels that make one target pixel.
struct Taps {
  int first = 0;
  std::vector<std::int64_t> weights;
};

/// @param length of the resampled stretch in source pixels; need not be whole
std::vector<Taps> TapsOf(int source, float length, int target) {
  const double scale = static_cast<double>(length) / target;
  const double filter = std::max(scale, 1.0);
  const double support = kLanczosWidth * filter;
  std::vector<Taps> all;
  for (int i = 0; i < target; ++i) {
    const double centre = (i + 0.5) * scale;
    Taps taps{std::max(static_cast<int>(centre - support + 0.5), 0), {}};
    const int end = std::min(static_cast<int>(centre + support + 0.5), source);
    std::vector<double> weights;
    double sum = 0;
    for (int j = taps.first; j < end; ++j) {
      weights.push_back(Lanczos((j - centre + 0.5) / filter));
      sum += weights.back();
    }
    for (const double weight : weights) taps.weights.push_back(std::llround(weight / sum * (1 << kWeightBits)));
    all.push_back(std::move(taps));
  }
  return all;
}

std::uint8_t Rounded(std::int64_t sum) {
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>((sum + (1 << (kWeightBits - 1))) >> kWeightBits, 0, 255));
}

cv::Mat ResampleRows(const cv::Mat& image, const std::vector<Taps>& taps) {
  cv::Mat out(image.rows, static_cast<int>(taps.size()), CV_8UC3);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < out.cols; ++x) {
      const Taps& tap = taps[static_cast<std::size_t>(x)];
      for (int c = 0; c < kChannels; ++c) {
        std::int64_t sum = 0;
        for (std::size_t j = 0; j < tap.weights.size(); ++j)
          sum += tap.weights[j] * image.at<cv::Vec3b>(y, tap.first + static_cast<int>(j))[c];
        out.at<cv::Vec3b>(y, x)[c] = Rounded(sum);
      }
    }
  }
  return out;
}

/// Means of boxes of fx x fy pixels; boxes at the right and lower edge may be smaller.
cv::Mat BoxAveraged(const cv::Mat& image, int fx, int fy) {
  cv::Mat out((image.rows + fy - 1) / fy, (image.cols + fx - 1) / fx, CV_8UC3);
  for (int y = 0; y < out.rows; ++y) {
    for (int x = 0; x < out.cols; ++x) {
      const cv::Rect box = cv::Rect(x * fx, y * fy, fx, fy) & cv::Rect({0, 0}, image.size());
      const auto count = static_cast<std::uint64_t>(box.area());
      const cv::Scalar sum = cv::sum(image(box));
      for (int c = 0; c < kChannels; ++c) {
        const auto whole = static_cast<std::uint64_t>(sum[c]);
        out.at<cv::Vec3b>(y, x)[c] = static_cast<std::uint8_t>(((whole + count / 2) * ((1u << 24) / count)) >> 24);
      }
    }
  }
  return out;
}

/// Of floor and ceil of `exact` the one that keeps the aspect ratio better.
template <typename Badness>
int BetterRounding(double exact, const Badness& badness) {
  const int low = static_cast<int>(std::floor(exact)), high = static_cast<int>(std::ceil(exact));
  return std::max(badness(low) <= badness(high) ? low : high, 1);
}

cv::Size FittedSize(cv::Size size, int fit) {
  if (size.width <= fit && size.height <= fit) return size;
  const double ratio = static_cast<double>(size.width) / size.height;
  if (ratio <= 1)
    return {BetterRounding(fit * ratio, [&](int width) { return std::abs(ratio - static_cast<double>(width) / fit); }), fit};
  return {fit, BetterRounding(fit / ratio, [&](int height) {
            return height == 0 ? 1e30 : std::abs(ratio - static_cast<double>(fit) / height);
          })};
}

cv::Mat WhiteSquare(int side) { return {side, side, CV_8UC3, cv::Scalar::all(255)}; }

/// The cubic through four samples with derivative weight -1, between the middle ones.
double Cubic(const std::array<double, 4>& v, double t) {
  return v[1] + t * (-v[0] + v[2] + t * (2 * (v[0] - v[1]) + v[2] - v[3] + t * (-v[0] + v[1] - v[2] + v[3])));
}

/// Columns are clamped to the picture; so is the first of the four rows, while rows beyond the bottom repeat the
/// value of the row before.
double BicubicAt(const cv::Mat& picture, double x, double y, int channel) {
  x -= 0.5;
  y -= 0.5;
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
  const auto row = [&](int row_index) {
    std::array<double, 4> samples{};
    for (int i = 0; i < 4; ++i)
      samples[i] = picture.at<cv::Vec3b>(row_index, std::clamp(left + i - 1, 0, picture.cols - 1))[channel];
    return Cubic(samples, x - left);
  };
  std::array<double, 4> rows{};
  rows[0] = row(std::clamp(top - 1, 0, picture.rows - 1));
  for (int i = 1; i < 4; ++i) {
    const int index = top + i - 1;
    rows[i] = index >= 0 && index < picture.rows ? row(index) : rows[i - 1];
  }
  return Cubic(rows, y - top);
}

double RoundedTo15Decimals(double value) { return std::round(value * 1e15) / 1e15; }

}  // namespace

cv::Mat ShrinkByLanczos(const cv::Mat& image, cv::Size size) {
  const int fx = std::max(image.cols / size.width / 2, 1), fy = std::max(image.rows / size.height / 2, 1);
  const cv::Mat reduced = fx > 1 || fy > 1 ? BoxAveraged(image, fx, fy) : image;
  const auto width = static_cast<float>(static_cast<double>(image.cols) / fx);
  const auto height = static_cast<float>(static_cast<double>(image.rows) / fy);
  const cv::Mat narrow = ResampleRows(reduced, TapsOf(reduced.cols, width, size.width));
  cv::Mat turned;
  cv::transpose(narrow, turned);
  cv::Mat out;
  cv::transpose(ResampleRows(turned, TapsOf(reduced.rows, height, size.height)), out);
  return out;
}

cv::Mat PaddedToSquare(const cv::Mat& picture, int side) {
  cv::Mat square = WhiteSquare(side);
  picture.copyTo(square(cv::Rect({(side - picture.cols) / 2, (side - picture.rows) / 2}, picture.size())));
  return square;
}

cv::Mat PrepareReferencePicture(const cv::Mat& image, int fit, int canvas) {
  if (image.type() != CV_8UC3 || image.empty()) throw Error("picture", "is no 8-bit colour picture");
  const cv::Size size = FittedSize(image.size(), fit);
  return PaddedToSquare(size == image.size() ? image : ShrinkByLanczos(image, size), canvas);
}

torch::Tensor PictureTensor(const cv::Mat& picture) {
  const cv::Mat dense = picture.isContinuous() ? picture : picture.clone();
  const auto bytes = torch::from_blob(dense.data, {1, dense.rows, dense.cols, kChannels}, torch::kByte);
  return bytes.to(torch::kFloat).permute({0, 3, 1, 2}).contiguous() / 255 * 2 - 1;
}

std::vector<cv::Mat> PicturesOf(const torch::Tensor& images) {
  const auto bytes = (images.to(torch::kCPU, torch::kFloat) * 255).to(torch::kByte).permute({0, 2, 3, 1}).contiguous();
  std::vector<cv::Mat> pictures;
  for (std::int64_t i = 0; i < bytes.size(0); ++i)
    pictures.push_back(cv::Mat(static_cast<int>(bytes.size(1)), static_cast<int>(bytes.size(2)), CV_8UC3,
                               bytes[i].data_ptr()).clone());
  return pictures;
}

cv::Rect BoxOfObject(const cv::Mat& picture) {
  cv::Mat darkest = cv::Mat(picture.size(), CV_8U, cv::Scalar(255));
  for (int c = 0; c < kChannels; ++c) {
    cv::Mat channel;
    cv::extractChannel(picture, channel, c);
    darkest = cv::min(darkest, channel);
  }
  const cv::Rect box = cv::boundingRect(darkest < kNearWhite);
  if (box.width < 2 || box.height < 2) throw Error("picture", "shows nothing but white");
  return {box.x, box.y, box.width - 1, box.height - 1};
}

cv::Mat TurnedOnWhite(const cv::Mat& picture, double angle_deg) {
  const int side = static_cast<int>(std::sqrt(static_cast<double>(picture.cols) * picture.cols +
                                              static_cast<double>(picture.rows) * picture.rows));
  const cv::Mat square = PaddedToSquare(picture, side);
  if (std::fmod(angle_deg, 360) == 0) return square;
  const double radians = -RadiansFromDegrees(angle_deg);
  const double cosine = RoundedTo15Decimals(std::cos(radians)), sine = RoundedTo15Decimals(std::sin(radians));
  const double half = side / 2.0;
  const double shift_x = cosine * -half + sine * -half + half, shift_y = -sine * -half + cosine * -half + half;
  cv::Mat turned = WhiteSquare(side);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const double source_x = cosine * (x + 0.5) + sine * (y + 0.5) + shift_x;
      const double source_y = -sine * (x + 0.5) + cosine * (y + 0.5) + shift_y;
      if (source_x < 0 || source_x >= side || source_y < 0 || source_y >= side) continue;
      for (int c = 0; c < kChannels; ++c)
        turned.at<cv::Vec3b>(y, x)[c] =
            static_cast<std::uint8_t>(std::clamp(BicubicAt(square, source_x, source_y, c), 0.0, 255.0));
    }
  }
  return turned;
}

}  // namespace antipode
