#include "antipode/matching/two_view_geometry.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/matching/sampson_refinement.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr std::size_t kMinimalSample = 5;
constexpr double kExplainedShare = 0.95;  // of the inliers, by a simpler model
constexpr int kRefinements = 3;

double SampsonDistance(const RayPair& rays, const Rigid3& pose) {
  return std::abs(SignedSampsonDistance<double>(rays, pose.rotation, pose.translation));
}

/// Points on the plane at depth 1, as OpenCV takes them.
std::vector<cv::Point2d> OnPlane(const std::vector<RayPair>& rays, Eigen::Vector3d RayPair::* which) {
  std::vector<cv::Point2d> points;
  for (const RayPair& pair : rays) points.emplace_back((pair.*which).x(), (pair.*which).y());
  return points;
}

std::vector<RayPair> Select(const std::vector<RayPair>& rays, const std::vector<std::uint8_t>& chosen) {
  std::vector<RayPair> selected;
  for (std::size_t i = 0; i < rays.size(); ++i)
    if (chosen[i]) selected.push_back(rays[i]);
  return selected;
}

/// Works on rays, with all thresholds on the plane at depth 1.
class Estimator {
 public:
  Estimator(std::vector<RayPair> rays, double focal_length, const TwoViewGeometryOptions& options)
      : rays_(std::move(rays)), focal_length_(focal_length), options_(options) {}

  TwoViewGeometry FromScratch() {
    if (rays_.size() < std::max<std::size_t>(kMinimalSample, options_.least_inliers)) return Failure();
    const std::optional<Rigid3> pose = DrawPose();
    return pose ? Refine(*pose, 2 * options_.threshold_px) : Failure();
  }

  TwoViewGeometry Refine(Rigid3 pose, double capture_px) {
    TwoViewGeometry result;
    for (int i = 0; i < kRefinements; ++i) {
      const double range = ScaleOfStep(capture_px, options_.threshold_px, i, kRefinements);
      const std::vector<RayPair> near = Select(rays_, Inliers(pose, range));
      if (near.size() < kMinimalSample + 1) return Failure();
      const RefinedPose refined = RefineBySampsonError(near, pose, focal_length_, range / 2);
      pose = refined.query_from_reference;
      result.covariance = refined.covariance;
    }
    result.query_from_reference = pose;
    result.is_inlier = Inliers(pose, options_.threshold_px);
    result.inliers = static_cast<int>(std::count(result.is_inlier.begin(), result.is_inlier.end(), 1));
    if (result.inliers < options_.least_inliers) return Failure();
    NameDegeneracy(Select(rays_, result.is_inlier), result);
    return result;
  }

 private:
  TwoViewGeometry Failure() const {
    TwoViewGeometry failure;
    failure.is_inlier.assign(rays_.size(), 0);
    return failure;
  }

  double ThresholdOnPlane() const { return options_.threshold_px / focal_length_; }

  std::vector<std::uint8_t> Inliers(const Rigid3& pose, double range_px) const {
    std::vector<std::uint8_t> inliers;
    for (const RayPair& pair : rays_) inliers.push_back(SampsonDistance(pair, pose) * focal_length_ < range_px);
    return inliers;
  }

  std::optional<Rigid3> DrawPose() const {
    const auto reference = OnPlane(rays_, &RayPair::reference), query = OnPlane(rays_, &RayPair::query);
    const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
    cv::Mat essential, mask;
    try {
      essential = cv::findEssentialMat(reference, query, identity, cv::USAC_MAGSAC, options_.confidence,
                                       ThresholdOnPlane(), options_.iterations, mask);
    } catch (const cv::Exception&) {
      return std::nullopt;  // OpenCV gives up on some degenerate sets in this way
    }
    if (essential.rows != 3 || essential.cols != 3) return std::nullopt;
    cv::Mat rotation, translation;
    // Points of every distance count: those that are far tell the rotation best.
    constexpr double kAnyDistance = 1e9;
    cv::recoverPose(essential, reference, query, identity, rotation, translation, kAnyDistance, mask);
    Rigid3 pose;
    cv::cv2eigen(rotation, pose.rotation);
    Eigen::Matrix<double, 3, 1> direction;
    cv::cv2eigen(translation, direction);
    pose.translation = direction;
    return pose;
  }

  /// Without parallax the essential matrix says nothing reliable, but the rotation alone does.
  void NameDegeneracy(const std::vector<RayPair>& inliers, TwoViewGeometry& result) const {
    const double needed = kExplainedShare * static_cast<double>(inliers.size());
    const Eigen::Matrix3d turn = BestTurn(inliers);
    if (ExplainedByTurn(inliers, turn) >= needed) {
      result.status = TwoViewStatus::kPureRotation;
      result.query_from_reference.rotation = turn;
      return;
    }
    result.status = ExplainedByPlane(inliers) >= needed ? TwoViewStatus::kPlanar : TwoViewStatus::kFound;
  }

  static Eigen::Matrix3d BestTurn(const std::vector<RayPair>& inliers) {
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    for (const RayPair& pair : inliers) moment += pair.query.normalized() * pair.reference.normalized().transpose();
    return NearestRotation(moment);
  }

  int ExplainedByTurn(const std::vector<RayPair>& inliers, const Eigen::Matrix3d& turn) const {
    int count = 0;
    for (const RayPair& pair : inliers) {
      const Eigen::Vector3d turned = turn * pair.reference;
      count += turned.z() > 0 && (turned.hnormalized() - pair.query.hnormalized()).norm() < 2 * ThresholdOnPlane();
    }
    return count;
  }

  int ExplainedByPlane(const std::vector<RayPair>& inliers) const {
    cv::Mat mask;
    const cv::Mat homography = cv::findHomography(OnPlane(inliers, &RayPair::reference), OnPlane(inliers, &RayPair::query),
                                                  cv::RANSAC, 2 * ThresholdOnPlane(), mask);
    return homography.empty() ? 0 : cv::countNonZero(mask);
  }

  std::vector<RayPair> rays_;
  double focal_length_;
  const TwoViewGeometryOptions& options_;
};

}  // namespace

std::string NameOf(TwoViewStatus status) {
  switch (status) {
    case TwoViewStatus::kFound: return "found";
    case TwoViewStatus::kPlanar: return "planar";
    case TwoViewStatus::kPureRotation: return "pure rotation";
    case TwoViewStatus::kTooFewMatches: break;
  }
  return "too few matches";
}

void TwoViewGeometryOptions::Check() const {
  if (!(threshold_px > 0)) throw InvalidOption("threshold_px", "must be positive");
  if (!(confidence > 0) || !(confidence < 1)) throw InvalidOption("confidence", "must be between 0 and 1");
  if (iterations < 1) throw InvalidOption("iterations", "must be positive");
  if (least_inliers < 6) throw InvalidOption("least_inliers", "must be at least 6", "five points always fit");
}

double TwoViewGeometry::RotationDeviationDeg() const {
  return DegreesFromRadians(std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3));
}

std::vector<double> SampsonDistances(const Correspondences& correspondences, const CameraPair& cameras,
                                     const Rigid3& query_from_reference) {
  std::vector<double> distances;
  for (const RayPair& pair : RaysOf(correspondences, cameras.reference, cameras.query))
    distances.push_back(cameras.MeanFocalLength() * SampsonDistance(pair, query_from_reference));
  return distances;
}

TwoViewGeometry EstimateTwoViewGeometry(const Correspondences& correspondences, const CameraPair& cameras,
                                        const TwoViewGeometryOptions& options) {
  options.Check();
  return Estimator(RaysOf(correspondences, cameras.reference, cameras.query), cameras.MeanFocalLength(), options).FromScratch();
}

TwoViewGeometry RefineTwoViewGeometry(const Correspondences& correspondences, const CameraPair& cameras,
                                      const Rigid3& initial_query_from_reference, double capture_px,
                                      const TwoViewGeometryOptions& options) {
  options.Check();
  Rigid3 initial = initial_query_from_reference;
  if (!(initial.translation.norm() > 0)) throw Error("two-view geometry", "got an initial pose without translation");
  initial.translation.normalize();
  return Estimator(RaysOf(correspondences, cameras.reference, cameras.query), cameras.MeanFocalLength(), options)
      .Refine(initial, std::max(capture_px, options.threshold_px));
}

}  // namespace antipode
