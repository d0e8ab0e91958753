#include "antipode/matching/sift.h"

#include <algorithm>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kLeastSide = 16;  // less holds no keypoint that could be told from another

/// OpenCV gives pixel indices, too large by a quarter: it doubles the image first and leaves out
/// that this moves the centres of pixels.
constexpr double kPixelFromKeypoint = 0.5 - 0.25;

struct Features {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;  // [keypoints, 128]
};

void ToRootSift(cv::Mat& descriptors) {
  for (int row = 0; row < descriptors.rows; ++row) {
    cv::Mat descriptor = descriptors.row(row);
    cv::normalize(descriptor, descriptor, 1, 0, cv::NORM_L1);
  }
  cv::sqrt(descriptors, descriptors);
}

Features FindFeatures(const cv::Mat& rgb, int max_features) {
  if (rgb.empty()) return {};
  if (rgb.type() != CV_8UC3) {
    throw Error("SIFT", "was given an image that is not 8-bit RGB", "convert it to 8UC3");
  }
  if (std::min(rgb.rows, rgb.cols) < kLeastSide) return {};
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  Features features;
  cv::SIFT::create(max_features)
      ->detectAndCompute(grey, cv::noArray(), features.keypoints, features.descriptors);
  ToRootSift(features.descriptors);
  return features;
}

/// The nearest descriptor, and how its distance compares to that of the second nearest.
struct Nearest {
  int index = -1;
  double ratio = 1;
};

std::vector<Nearest> NearestOf(const cv::Mat& descriptors, const cv::Mat& others) {
  std::vector<std::vector<cv::DMatch>> found;
  cv::BFMatcher(cv::NORM_L2).knnMatch(descriptors, others, found, 2);
  std::vector<Nearest> nearest(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const cv::DMatch &first = found[i][0], &second = found[i][1];
    nearest[i] = {first.trainIdx, second.distance > 0 ? first.distance / second.distance : 1.0};
  }
  return nearest;
}

Eigen::Vector2d PixelOf(const cv::KeyPoint& keypoint) {
  return {keypoint.pt.x + kPixelFromKeypoint, keypoint.pt.y + kPixelFromKeypoint};
}

}  // namespace

void SiftMatcherOptions::Check() const {
  if (max_features < 2) throw InvalidOption("max_features", "must be at least 2");
  if (!(max_ratio > 0 && max_ratio <= 1))
    throw InvalidOption("max_ratio", "must be above 0 and at most 1");
}

SiftMatcher::SiftMatcher(const SiftMatcherOptions& options) : options_(options) {
  options_.Check();
}

Correspondences SiftMatcher::Match(const cv::Mat& reference, const cv::Mat& query) const {
  const Features of_reference = FindFeatures(reference, options_.max_features);
  const Features of_query = FindFeatures(query, options_.max_features);
  if (of_reference.descriptors.rows < 2 || of_query.descriptors.rows < 2) return {};
  const std::vector<Nearest> forward = NearestOf(of_reference.descriptors, of_query.descriptors);
  const std::vector<Nearest> backward = NearestOf(of_query.descriptors, of_reference.descriptors);
  Correspondences correspondences;
  for (std::size_t i = 0; i < forward.size(); ++i) {
    const Nearest& back = backward[forward[i].index];
    const double ratio = std::max(forward[i].ratio, back.ratio);
    if (back.index != static_cast<int>(i) || ratio >= options_.max_ratio) continue;
    correspondences.reference.push_back(PixelOf(of_reference.keypoints[i]));
    correspondences.query.push_back(PixelOf(of_query.keypoints[forward[i].index]));
    correspondences.scores.push_back(1 - ratio);
  }
  return correspondences;
}

}  // namespace antipode
