#include "antipode/matching/depth_pose.h"

#include <cmath>
#include <random>

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>

#include "antipode/util/error.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

constexpr double kMillimetre = 1e-3;

/// In camera coordinates; nothing where the depth is unknown.
std::optional<Eigen::Vector3d> Lift(const PinholeCamera& camera, const cv::Mat& depth, const Eigen::Vector2d& pixel) {
  const cv::Point cell(static_cast<int>(std::floor(pixel.x())), static_cast<int>(std::floor(pixel.y())));
  if (!cv::Rect({0, 0}, depth.size()).contains(cell)) return std::nullopt;
  const float value = depth.at<float>(cell);
  if (!std::isfinite(value) || value <= 0) return std::nullopt;
  return camera.Ray(pixel) * value;
}

void CheckDepth(const cv::Mat& depth, const char* whose) {
  if (depth.type() != CV_32FC1 || depth.empty())
    throw Error(std::string(whose) + " depth", "is missing or not a float image", "give a depth image");
}

struct PointPair {
  Eigen::Vector3d reference, query;
};

Rigid3 Align(const std::vector<PointPair>& pairs) {
  Eigen::Matrix3Xd reference(3, pairs.size()), query(3, pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    reference.col(i) = pairs[i].reference;
    query.col(i) = pairs[i].query;
  }
  const Eigen::Matrix4d matrix = Eigen::umeyama(reference, query, false);
  return {matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>()};
}

std::vector<PointPair> Agreeing(const std::vector<PointPair>& pairs, const Rigid3& pose, double distance) {
  std::vector<PointPair> agreeing;
  for (const PointPair& pair : pairs)
    if ((pose * pair.reference - pair.query).norm() < distance) agreeing.push_back(pair);
  return agreeing;
}

}  // namespace

cv::Mat LoadDepth(const std::filesystem::path& path, cv::Size expected, std::optional<double> unit) {
  if (unit && !(*unit > 0 && std::isfinite(*unit))) throw InvalidOption("depth unit", "is not a positive number");
  if (!std::filesystem::is_regular_file(path)) throw BadFile(path.string(), "is not a file", "check the path");
  const cv::Mat raw = cv::imread(path.string(), cv::IMREAD_UNCHANGED);
  if (raw.type() != CV_16UC1 && raw.type() != CV_32FC1)
    throw BadFile(path.string(), "is not a depth image", "give a 16-bit PNG or a float32 TIFF of one channel");
  if (raw.size() != expected)
    throw BadFile(path.string(), "is of another size than its image", "resize it without interpolation");
  cv::Mat depth;
  raw.convertTo(depth, CV_32F, unit.value_or(raw.type() == CV_16UC1 ? kMillimetre : 1));
  return depth;
}

std::optional<Rigid3> PoseFromPnp(const Correspondences& correspondences, const CameraPair& cameras,
                                  const cv::Mat& reference_depth, const DepthPoseOptions& options) {
  CheckDepth(reference_depth, "reference");
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (std::size_t i = 0; i < correspondences.size(); ++i) {
    const auto point = Lift(cameras.reference, reference_depth, correspondences.reference[i]);
    if (!point) continue;
    points.emplace_back(point->x(), point->y(), point->z());
    pixels.emplace_back(correspondences.query[i].x(), correspondences.query[i].y());
  }
  if (points.size() < 4) return std::nullopt;
  cv::Mat intrinsics;
  cv::eigen2cv(cameras.query.Intrinsics(), intrinsics);
  cv::Mat rotation_vector, translation;
  std::vector<int> inliers;
  const bool found = cv::solvePnPRansac(points, pixels, intrinsics, cv::noArray(), rotation_vector, translation, false,
                                        options.iterations, static_cast<float>(options.reprojection_px),
                                        options.confidence, inliers, cv::SOLVEPNP_P3P);
  if (!found) return std::nullopt;
  if (inliers.size() >= 6) {
    std::vector<cv::Point3d> near_points;
    std::vector<cv::Point2d> near_pixels;
    for (const int i : inliers) {
      near_points.push_back(points[i]);
      near_pixels.push_back(pixels[i]);
    }
    cv::solvePnPRefineLM(near_points, near_pixels, intrinsics, cv::noArray(), rotation_vector, translation);
  }
  cv::Mat rotation;
  cv::Rodrigues(rotation_vector, rotation);
  Rigid3 pose;
  cv::cv2eigen(rotation, pose.rotation);
  Eigen::Matrix<double, 3, 1> offset;
  cv::cv2eigen(translation, offset);
  pose.translation = offset;
  if (!pose.rotation.allFinite() || !pose.translation.allFinite()) return std::nullopt;
  return pose;
}

std::optional<Rigid3> PoseFromProcrustes(const Correspondences& correspondences, const CameraPair& cameras,
                                         const cv::Mat& reference_depth, const cv::Mat& query_depth,
                                         const DepthPoseOptions& options) {
  CheckDepth(reference_depth, "reference");
  CheckDepth(query_depth, "query");
  std::vector<PointPair> pairs;
  for (std::size_t i = 0; i < correspondences.size(); ++i) {
    const auto reference = Lift(cameras.reference, reference_depth, correspondences.reference[i]);
    const auto query = Lift(cameras.query, query_depth, correspondences.query[i]);
    if (reference && query) pairs.push_back({*reference, *query});
  }
  if (pairs.size() < 3) return std::nullopt;
  std::mt19937_64 random(options.seed);
  std::vector<PointPair> best;
  for (int i = 0; i < options.iterations; ++i) {
    std::vector<PointPair> sample;
    for (int k = 0; k < 3; ++k) sample.push_back(pairs[UniformIndex(random, pairs.size())]);
    std::vector<PointPair> agreeing = Agreeing(pairs, Align(sample), options.distance);
    if (agreeing.size() > best.size()) best = std::move(agreeing);
  }
  if (best.size() < 3) return std::nullopt;
  const Rigid3 pose = Align(best);
  if (!pose.rotation.allFinite()) return std::nullopt;
  return pose;
}

}  // namespace antipode
