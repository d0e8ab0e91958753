#include "stored_pictures.h"

#include <cmath>
#include <span>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "antipode/util/error.h"

namespace antipode::golden {
namespace {

NumericTensor Stacked(const std::vector<cv::Mat>& pictures, FirstAxis first, bool channels_first) {
  const std::int64_t rows = pictures.front().rows, columns = pictures.front().cols;
  NumericTensor tensor(channels_first ? std::vector<std::int64_t>{3, rows, columns} : std::vector<std::int64_t>{rows, columns, 3});
  if (first == FirstAxis::kWith) tensor.shape.insert(tensor.shape.begin(), static_cast<std::int64_t>(pictures.size()));
  for (const cv::Mat& picture : pictures) {
    if (!channels_first) {
      for (int y = 0; y < rows; ++y)
        tensor.values.insert(tensor.values.end(), picture.ptr<std::uint8_t>(y), picture.ptr<std::uint8_t>(y) + 3 * columns);
      continue;
    }
    for (int channel = 0; channel < 3; ++channel)
      for (int y = 0; y < rows; ++y)
        for (int x = 0; x < columns; ++x) tensor.values.push_back(picture.at<cv::Vec3b>(y, x)[channel]);
  }
  return tensor;
}

cv::Vec3d PixelOr(const cv::Mat& picture, int x, int y, double border) {
  if (x < 0 || y < 0 || x >= picture.cols || y >= picture.rows) return cv::Vec3d::all(border);
  return picture.at<cv::Vec3b>(y, x);
}

}  // namespace

cv::Mat Picture(const NumericTensor& stored, std::int64_t index) {
  const std::size_t axes = stored.shape.size();
  if (axes != (index < 0 ? 3u : 4u) || stored.shape.back() != 3) throw Error("golden input", "is no picture");
  const int rows = static_cast<int>(stored.shape[axes - 3]), columns = static_cast<int>(stored.shape[axes - 2]);
  cv::Mat picture(rows, columns, CV_8UC3);
  const std::size_t size = std::size_t(3) * rows * columns;
  const double* const begin = stored.values.data() + (index < 0 ? 0 : index * size);
  for (std::size_t i = 0; i < size; ++i) picture.data[i] = static_cast<std::uint8_t>(begin[i]);
  return picture;
}

NumericTensor ChannelsLast(const std::vector<cv::Mat>& pictures, FirstAxis first) { return Stacked(pictures, first, false); }
NumericTensor ChannelsFirst(const std::vector<cv::Mat>& pictures, FirstAxis first) { return Stacked(pictures, first, true); }

published::InclusiveBox NonWhiteBoxOf(const cv::Mat& picture) {
  return published::NonWhiteBox(std::span(picture.data, picture.total() * 3), picture.cols, picture.rows);
}

NumericTensor ExactWarp(const cv::Mat& picture, const Eigen::Matrix3d& target_from_source, int size, double border) {
  const Eigen::Matrix3d source_from_target = target_from_source.inverse();
  NumericTensor tensor({size, size, 3});
  for (int v = 0; v < size; ++v) {
    for (int u = 0; u < size; ++u) {
      const Eigen::Vector2d at = (source_from_target * Eigen::Vector3d(u, v, 1)).hnormalized();
      const int x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
      const double a = at.x() - x, b = at.y() - y;
      const cv::Vec3d value = (1 - b) * ((1 - a) * PixelOr(picture, x, y, border) + a * PixelOr(picture, x + 1, y, border)) +
                              b * ((1 - a) * PixelOr(picture, x, y + 1, border) + a * PixelOr(picture, x + 1, y + 1, border));
      tensor.values.insert(tensor.values.end(), value.val, value.val + 3);
    }
  }
  return tensor;
}

}  // namespace antipode::golden
