#include "antipode/image/blob.h"

#include <opencv2/imgproc.hpp>

namespace antipode {
namespace {

constexpr int kObjectAbove = 125;
constexpr double kNoteworthyShare = 0.01;

int LargestLabel(const cv::Mat& stats) {
  int best = 1;
  for (int label = 2; label < stats.rows; ++label) {
    if (stats.at<int>(label, cv::CC_STAT_AREA) > stats.at<int>(best, cv::CC_STAT_AREA))
      best = label;
  }
  return best;
}

/// `mask` where it is within two pixels of the blob and belongs to no other blob.
cv::Mat WithoutOtherBlobs(const cv::Mat& mask, const cv::Mat& solid, const cv::Mat& blob) {
  cv::Mat keep;
  cv::dilate(blob, keep, cv::getStructuringElement(cv::MORPH_RECT, {5, 5}));
  keep.setTo(0, solid & ~blob);
  cv::Mat kept = cv::Mat::zeros(mask.size(), CV_8UC1);
  mask.copyTo(kept, keep);
  return kept;
}

}  // namespace

LargestBlob FindLargestBlob(const cv::Mat& mask) {
  LargestBlob result;
  result.mask = mask;
  const cv::Mat solid = mask > kObjectAbove;
  const cv::Rect region = cv::boundingRect(solid);
  if (region.empty()) return result;

  cv::Mat labels, stats, centroids;
  const int label_count =
      cv::connectedComponentsWithStats(solid(region), labels, stats, centroids, 8, CV_32S);
  const int label = LargestLabel(stats);
  const int* const blob = stats.ptr<int>(label);
  result.blob_count = label_count - 1;
  result.box = cv::Rect(blob[cv::CC_STAT_LEFT], blob[cv::CC_STAT_TOP], blob[cv::CC_STAT_WIDTH],
                        blob[cv::CC_STAT_HEIGHT]) +
               region.tl();
  const double solid_count =
      static_cast<double>(region.area()) - stats.at<int>(0, cv::CC_STAT_AREA);
  result.area_share = blob[cv::CC_STAT_AREA] / solid_count;
  result.fills_image = static_cast<size_t>(blob[cv::CC_STAT_AREA]) == mask.total();
  if (result.blob_count == 1) return result;

  cv::Mat whole_blob = cv::Mat::zeros(mask.size(), CV_8UC1);
  cv::Mat(labels == label).copyTo(whole_blob(region));
  result.mask = WithoutOtherBlobs(mask, solid, whole_blob);
  return result;
}

std::vector<std::string> BlobWarnings(const LargestBlob& blob, const cv::Size& image_size) {
  std::vector<std::string> warnings;
  if (blob.blob_count > 1 && 1 - blob.area_share >= kNoteworthyShare) {
    warnings.push_back("the mask has " + std::to_string(blob.blob_count) +
                       " separate parts; only the largest is used");
  }
  if (TouchesBorder(blob.box, image_size)) {
    warnings.push_back("the mask touches the image border; the object may be cut off");
  }
  return warnings;
}

bool TouchesBorder(const cv::Rect& box, const cv::Size& size) {
  return box.x <= 0 || box.y <= 0 || box.br().x >= size.width || box.br().y >= size.height;
}

}  // namespace antipode
