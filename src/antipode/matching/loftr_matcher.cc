#include "antipode/matching/loftr_matcher.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "antipode/matching/correspondence_list.h"
#include "antipode/matching/network_input.h"
#include "antipode/nn/module_weights.h"
#include "antipode/util/error.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

constexpr int kSideStep = 8;
constexpr double kLargestEnlargement = 2;
constexpr double kLeastContrast = 1;  // standard deviation in grey levels; less is noise

int NetworkSide(int side, double scale) {
  return std::max(1, static_cast<int>(std::lround(side * scale / kSideStep))) * kSideStep;
}

cv::Size NetworkSize(cv::Size image, int max_side) {
  const double scale = std::min(
      kLargestEnlargement, static_cast<double>(max_side) / std::max(image.width, image.height));
  return {NetworkSide(image.width, scale), NetworkSide(image.height, scale)};
}

/// Grey in 0..255 as the network sees it.
cv::Mat NetworkImage(const cv::Mat& rgb, int max_side) {
  if (rgb.type() != CV_8UC3)
    throw Error("LoFTR", "was given an image that is not 8-bit RGB", "convert it to 8UC3");
  const cv::Size size = NetworkSize(rgb.size(), max_side);
  const bool shrinks = size.area() < rgb.size().area();
  cv::Mat grey, resized;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  cv::resize(grey, resized, size, 0, 0, shrinks ? cv::INTER_AREA : cv::INTER_LINEAR);
  return resized;
}

bool HasTexture(const cv::Mat& grey) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(grey, mean, deviation);
  return deviation[0] >= kLeastContrast;
}

torch::Tensor ToTensor(const cv::Mat& grey, torch::Device device) {
  const auto pixels = torch::from_blob(grey.data, {1, 1, grey.rows, grey.cols}, torch::kUInt8);
  return pixels.to(torch::kFloat).div_(255).to(device);
}

torch::Tensor InImage(const torch::Tensor& points, cv::Size seen, const cv::Mat& image) {
  return ToImagePixels(points.to(torch::kCPU, torch::kDouble), seen, image.size());
}

}  // namespace

void LoftrMatcherOptions::Check() const {
  if (max_side < 64 || max_side > 2048)
    throw InvalidOption("max_side", "must be 64 to 2048 pixels");
  network.Check();
}

LoftrMatcher LoftrMatcher::Load(const std::string& model_or_folder,
                                const LoftrMatcherOptions& options, torch::Device device) {
  Loftr network;
  LoadInto(*network, LoadModel(model_or_folder), model_or_folder);
  return LoftrMatcher(std::move(network), options, device);
}

LoftrMatcher::LoftrMatcher(Loftr network, const LoftrMatcherOptions& options, torch::Device device)
    : network_(std::move(network)), options_(options), device_(device) {
  options_.Check();
  network_->to(device_);
  network_->eval();
}

Correspondences LoftrMatcher::Match(const cv::Mat& reference, const cv::Mat& query) const {
  if (reference.empty() || query.empty()) return {};
  const cv::Mat seen_reference = NetworkImage(reference, options_.max_side);
  const cv::Mat seen_query = NetworkImage(query, options_.max_side);
  if (!HasTexture(seen_reference) || !HasTexture(seen_query)) return {};
  const torch::InferenceMode inference;
  Loftr network = network_;
  const LoftrOutput output = network->forward(ToTensor(seen_reference, device_),
                                              ToTensor(seen_query, device_), options_.network);
  return ToCorrespondences(InImage(output.first_points, seen_reference.size(), reference),
                           InImage(output.second_points, seen_query.size(), query),
                           output.pairs.confidences);
}

}  // namespace antipode
