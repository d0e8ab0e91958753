#pragma once

#include "antipode/matching/matcher.h"

namespace antipode {

struct SiftMatcherOptions {
  int max_features = 2048;  ///< the strongest of each image
  /// A match must be nearer than this share of the distance to the second nearest, seen from either
  /// image.
  double max_ratio = 0.8;

  void Check() const;  ///< @throws InvalidOption naming the field
};

/// Correspondences by SIFT (Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", IJCV
/// 2004) in grey, with descriptors as RootSIFT (Arandjelovic and Zisserman, CVPR 2012): the square
/// roots of the descriptor divided by its sum. Pairs that are each other's nearest and pass the
/// ratio test from both sides; so swapping the images swaps the points. The score is 1 - the larger
/// of the two ratios.
class SiftMatcher : public Matcher {
 public:
  /// @throws InvalidOption
  explicit SiftMatcher(const SiftMatcherOptions& options = {});

  /// @throws Error if an image is not 8UC3
  Correspondences Match(const cv::Mat& reference, const cv::Mat& query) const override;

 private:
  SiftMatcherOptions options_;
};

}  // namespace antipode
