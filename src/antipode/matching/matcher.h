#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace antipode {

/// Points of two images that show the same surface point. All three lists have the same length.
struct Correspondences {
  std::vector<Eigen::Vector2d> reference;  ///< pixels, centres at integer + 0.5
  std::vector<Eigen::Vector2d> query;      ///< pixels, centres at integer + 0.5
  std::vector<double> scores;              ///< 0..1, the matcher's own certainty

  std::size_t size() const { return scores.size(); }
};

/// Finds correspondences between two images.
class Matcher {
 public:
  virtual ~Matcher() = default;

  /// @param reference,query RGB, 8UC3, of any size each
  /// @return empty if nothing is found
  virtual Correspondences Match(const cv::Mat& reference, const cv::Mat& query) const = 0;
};

}  // namespace antipode
