#include "antipode/matching/centred_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <ceres/ceres.h>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kStages = 4;                      // of sigma, in equal factors
constexpr int kIterationsPerStage = 4;
constexpr int kOffsets = 5;                     // a, b, c, d, g
constexpr double kLeastDepth = 0.05;            // of a point before the query camera, object radii
constexpr double kShortestSegment = 1e-6;       // of an epipolar line, on the plane at depth 1
constexpr double kLeastShareOfDistance = 0.2;   // of a point before the reference camera

/// t = c_q - R c_r.
template <typename T>
Eigen::Matrix<T, 3, 1> TranslationOf(const CentredCameras& cameras, const Eigen::Matrix<T, 3, 3>& rotation, const T* offsets) {
  using std::exp;
  const Eigen::Matrix<T, 3, 1> in_reference(offsets[0], offsets[1], T(1)), in_query(offsets[2], offsets[3], T(1));
  return cameras.query_distance * exp(offsets[4] / 2.0) * in_query -
         rotation * (cameras.reference_distance * exp(-offsets[4] / 2.0) * in_reference);
}

/// e and h of the header, on the plane at depth 1.
template <typename T>
Eigen::Matrix<T, 2, 1> Disagreement(const RayPair& rays, const CentredCameras& cameras, double half_depth,
                                    const Eigen::Matrix<T, 3, 3>& rotation, const Eigen::Matrix<T, 3, 1>& translation) {
  using Point = Eigen::Matrix<T, 2, 1>;
  const Eigen::Matrix<T, 3, 1> direction = rotation * rays.reference.cast<T>();
  const auto seen_at = [&](double depth) -> Point {
    const Eigen::Matrix<T, 3, 1> point = depth * direction + translation;
    return point.template head<2>() / (point.z() > T(kLeastDepth) ? point.z() : T(kLeastDepth));
  };
  const double distance = cameras.reference_distance;
  const Point nearest = seen_at(std::max(distance - half_depth, kLeastShareOfDistance * distance));
  const Point along = seen_at(distance + half_depth) - nearest, from_nearest = rays.query.head<2>().cast<T>() - nearest;
  using std::sqrt;
  const T length = sqrt(along.squaredNorm() + T(1e-20));
  // Cameras at one place have no epipolar lines, but the point is where it is.
  const T place = length > T(kShortestSegment) ? from_nearest.dot(along) / length : sqrt(from_nearest.squaredNorm() + T(1e-20));
  const T beyond = place > length ? place - length : place < T(0) ? -place : T(0);
  return {SignedSampsonDistance<T>(rays, rotation, translation), beyond};
}

struct AgreementResidual {
  const RayPair& rays;
  const CentredCameras& cameras;
  double half_depth;
  const double& pixels_per_sigma;

  template <typename T>
  bool operator()(const T* rotation, const T* offsets, T* residual) const {
    const Eigen::Matrix<T, 3, 3> matrix = Eigen::Map<const Eigen::Quaternion<T>>(rotation).toRotationMatrix();
    Eigen::Map<Eigen::Matrix<T, 2, 1>> scaled(residual);
    scaled = pixels_per_sigma * Disagreement<T>(rays, cameras, half_depth, matrix, TranslationOf(cameras, matrix, offsets));
    return true;
  }
};

struct OffsetResidual {
  std::array<double, kOffsets> deviations;

  template <typename T>
  bool operator()(const T* offsets, T* residual) const {
    for (int i = 0; i < kOffsets; ++i) residual[i] = offsets[i] / deviations[i];
    return true;
  }
};

struct TurnResidual {
  Eigen::Quaterniond start;
  double deviation;

  template <typename T>
  bool operator()(const T* rotation, T* residual) const {
    const Eigen::Quaternion<T> turn = start.conjugate().cast<T>() * Eigen::Map<const Eigen::Quaternion<T>>(rotation);
    Eigen::Map<Eigen::Matrix<T, 3, 1>> scaled(residual);
    scaled = turn.vec() * (turn.w() < T(0) ? T(-2) : T(2)) / deviation;
    return true;
  }
};

/// rho(s) = 2 s / (1 + s): half of it is what an inlier lacks of 1.
class GemanMcClureLoss : public ceres::LossFunction {
 public:
  void Evaluate(double s, double rho[3]) const override {
    const double weight = 1 / (1 + s);
    rho[0] = 2 * s * weight;
    rho[1] = 2 * weight * weight;
    rho[2] = -4 * weight * weight * weight;
  }
};

std::array<double, kOffsets> Deviations(const CentredCameras& cameras, const CentredGeometryOptions& options) {
  const double in_reference = options.centre_deviation / cameras.reference_distance;
  const double in_query = options.centre_deviation / cameras.query_distance;
  return {in_reference, in_reference, in_query, in_query, options.ratio_deviation};
}

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

/// At most so many, evenly over the list, standing for all: those left out are taken to agree as often.
struct Sample {
  std::vector<RayPair> rays;
  double rays_for_each = 1;

  Sample(const std::vector<RayPair>& all, int most) {
    const std::size_t count = std::min(all.size(), static_cast<std::size_t>(most));
    for (std::size_t i = 0; i < count; ++i) rays.push_back(all[i * all.size() / count]);
    if (count > 0) rays_for_each = static_cast<double>(all.size()) / static_cast<double>(count);
  }
};

/// x and y of rays (x, y, 1), each an array.
struct RayArrays {
  Eigen::ArrayXf x, y;

  RayArrays(const std::vector<RayPair>& rays, Eigen::Vector3d RayPair::* which)
      : x(static_cast<Eigen::Index>(rays.size())), y(x.size()) {
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const Eigen::Vector3d& ray = rays[static_cast<std::size_t>(i)].*which;
      x[i] = static_cast<float>(ray.x());
      y[i] = static_cast<float>(ray.y());
    }
  }
};

/// sum_i 1 / (1 + (e_i / sigma)^2), sigma on the plane at depth 1.
float SoftInliers(const RayArrays& reference, const RayArrays& query, const Eigen::Matrix3f& essential, float sigma) {
  const auto line = [](const Eigen::Matrix3f& e, const RayArrays& rays, int row) {
    return e(row, 0) * rays.x + e(row, 1) * rays.y + e(row, 2);
  };
  const Eigen::ArrayXf in_query_x = line(essential, reference, 0), in_query_y = line(essential, reference, 1);
  const Eigen::Matrix3f back = essential.transpose();
  const auto in_reference_x = line(back, query, 0), in_reference_y = line(back, query, 1);
  const auto algebraic = query.x * in_query_x + query.y * in_query_y + line(essential, reference, 2);
  const Eigen::ArrayXf gradient =
      (in_query_x.square() + in_query_y.square() + in_reference_x.square() + in_reference_y.square() + 1e-20F) * (sigma * sigma);
  return (gradient / (gradient + algebraic.square())).sum();
}

double Penalty(const double* offsets, const std::array<double, kOffsets>& deviations) {
  Eigen::Matrix<double, kOffsets, 1> residuals;
  OffsetResidual{deviations}(offsets, residuals.data());
  return residuals.squaredNorm() / 2;
}

}  // namespace

void CentredGeometryOptions::Check() const {
  if (!(centre_deviation > 0)) throw InvalidOption("centre_deviation", "must be positive");
  if (!(ratio_deviation > 0)) throw InvalidOption("ratio_deviation", "must be positive");
  if (!(scale_px > 0)) throw InvalidOption("scale_px", "must be positive");
  if (!(search_scale_px >= scale_px)) throw InvalidOption("search_scale_px", "must not be less than scale_px");
  if (!(half_depth > 0)) throw InvalidOption("half_depth", "must be positive");
  if (!(turn_deviation_deg > 0)) throw InvalidOption("turn_deviation_deg", "must be positive");
  if (most_searched < 1 || most_refined < 1) throw InvalidOption("most_searched, most_refined", "must be positive");
}

CentredGeometry::CentredGeometry(const Correspondences& correspondences, const CentredCameras& cameras,
                                 const CentredGeometryOptions& options)
    : rays_(RaysOf(correspondences, cameras.cameras.reference, cameras.cameras.query)), cameras_(cameras), options_(options) {
  options.Check();
  if (!(cameras.reference_distance > 0) || !(cameras.query_distance > 0))
    throw Error("centred geometry", "got an object at no distance", "crop the object with MakeObjectView");
}

Eigen::VectorXf CentredGeometry::SearchSupport(std::span<const Eigen::Matrix3d> rotations) const {
  Eigen::VectorXf support = Eigen::VectorXf::Zero(static_cast<Eigen::Index>(rotations.size()));
  if (rays_.empty()) return support;
  const Sample sample(rays_, options_.most_searched);
  const RayArrays reference(sample.rays, &RayPair::reference), query(sample.rays, &RayPair::query);
  const auto matches_for_each = static_cast<float>(sample.rays_for_each);
  const auto sigma = static_cast<float>(options_.search_scale_px / cameras_.cameras.MeanFocalLength());
  constexpr double kCentred[kOffsets] = {};
  for (Eigen::Index i = 0; i < support.size(); ++i) {
    const Eigen::Matrix3d& rotation = rotations[i];
    const Eigen::Matrix3d essential = CrossMatrix(TranslationOf(cameras_, rotation, kCentred)) * rotation;
    support[i] = matches_for_each * SoftInliers(reference, query, essential.cast<float>(), sigma);
  }
  return support;
}

CentredGeometry::SupportedPose CentredGeometry::Centred(const Eigen::Matrix3d& rotation) const {
  constexpr double kCentred[kOffsets] = {};
  return WithSupport(rotation, kCentred);
}

CentredGeometry::SupportedPose CentredGeometry::WithSupport(const Eigen::Matrix3d& rotation, const double* offsets) const {
  SupportedPose pose{{rotation, TranslationOf(cameras_, rotation, offsets)}, 0};
  const double pixels_per_sigma = cameras_.cameras.MeanFocalLength() / options_.scale_px;
  for (const RayPair& pair : rays_) {
    const Eigen::Vector2d distances = pixels_per_sigma * Disagreement<double>(pair, cameras_, options_.half_depth, rotation,
                                                                              pose.query_from_reference.translation);
    pose.support += 1 / (1 + distances.squaredNorm());
  }
  pose.support -= Penalty(offsets, Deviations(cameras_, options_));
  return pose;
}

CentredGeometry::SupportedPose CentredGeometry::Refine(const Eigen::Matrix3d& start) const {
  if (rays_.empty()) return Centred(start);
  Eigen::Quaterniond rotation(start);
  double offsets[kOffsets] = {};
  double pixels_per_sigma = 0;
  const Sample sample(rays_, options_.most_refined);
  ceres::ScaledLoss loss(new GemanMcClureLoss, sample.rays_for_each, ceres::TAKE_OWNERSHIP);
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  problem.AddParameterBlock(rotation.coeffs().data(), 4, new ceres::EigenQuaternionManifold());
  problem.AddParameterBlock(offsets, kOffsets);
  for (const RayPair& pair : sample.rays)
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<AgreementResidual, 2, 4, kOffsets>(
            new AgreementResidual{pair, cameras_, options_.half_depth, pixels_per_sigma}),
        &loss, rotation.coeffs().data(), offsets);
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<OffsetResidual, kOffsets, kOffsets>(
                               new OffsetResidual{Deviations(cameras_, options_)}), nullptr, offsets);
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<TurnResidual, 3, 4>(
                               new TurnResidual{rotation, RadiansFromDegrees(options_.turn_deviation_deg)}), nullptr, rotation.coeffs().data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = kIterationsPerStage;
  options.logging_type = ceres::SILENT;
  for (int stage = 0; stage < kStages; ++stage) {
    pixels_per_sigma =
        cameras_.cameras.MeanFocalLength() / ScaleOfStep(options_.search_scale_px, options_.scale_px, stage, kStages);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
  }
  return WithSupport(rotation.normalized().toRotationMatrix(), offsets);
}

}  // namespace antipode
