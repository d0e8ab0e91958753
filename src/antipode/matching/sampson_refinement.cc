#include "antipode/matching/sampson_refinement.h"

#include <ceres/ceres.h>

#include <Eigen/LU>

namespace antipode {
namespace {

struct SampsonResidual {
  RayPair rays;
  double focal_length;

  template <typename T>
  bool operator()(const T* rotation, const T* direction, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> query_from_reference(rotation);
    const Eigen::Matrix<T, 3, 3> matrix = query_from_reference.toRotationMatrix();
    const Eigen::Matrix<T, 3, 1> translation(direction[0], direction[1], direction[2]);
    residual[0] = focal_length * SignedSampsonDistance<T>(rays, matrix, translation);
    return true;
  }
};

constexpr double kUndetermined = 1e300;

/// In the tangent space of the solution, scaled by the residuals' own variance.
Eigen::Matrix<double, 5, 5> CovarianceOf(ceres::Problem& problem, double variance) {
  ceres::CRSMatrix jacobian;
  problem.Evaluate({}, nullptr, nullptr, nullptr, &jacobian);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, 5, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> rows(jacobian.values.data(), jacobian.num_rows, 5);
  const Eigen::Matrix<double, 5, 5> information = rows.transpose() * rows;
  const Eigen::FullPivLU<Eigen::Matrix<double, 5, 5>> factors(information);
  if (!factors.isInvertible()) return Eigen::Matrix<double, 5, 5>::Constant(kUndetermined);
  Eigen::Matrix<double, 5, 5> covariance = factors.inverse();
  // A quaternion's tangent vector is half the rotation vector.
  covariance.topRows<3>() *= 2;
  covariance.leftCols<3>() *= 2;
  return covariance * variance;
}

}  // namespace

std::vector<RayPair> RaysOf(const Correspondences& correspondences, const PinholeCamera& reference, const PinholeCamera& query) {
  std::vector<RayPair> rays;
  rays.reserve(correspondences.size());
  for (std::size_t i = 0; i < correspondences.size(); ++i)
    rays.push_back({reference.Ray(correspondences.reference[i]), query.Ray(correspondences.query[i])});
  return rays;
}

RefinedPose RefineBySampsonError(const std::vector<RayPair>& rays, const Rigid3& initial, double focal_length,
                                 double scale_px) {
  Eigen::Quaterniond rotation(initial.rotation);
  Eigen::Vector3d direction = initial.translation.normalized();
  ceres::Problem problem;
  problem.AddParameterBlock(rotation.coeffs().data(), 4, new ceres::EigenQuaternionManifold());
  problem.AddParameterBlock(direction.data(), 3, new ceres::SphereManifold<3>());
  for (const RayPair& pair : rays)
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SampsonResidual, 1, 4, 3>(new SampsonResidual{pair, focal_length}),
                             new ceres::CauchyLoss(scale_px), rotation.coeffs().data(), direction.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 50;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  const double degrees_of_freedom = std::max<double>(1, static_cast<double>(rays.size()) - 5);
  const double variance = 2 * summary.final_cost / degrees_of_freedom;
  return {{rotation.normalized().toRotationMatrix(), direction},
          CovarianceOf(problem, variance)};
}

}  // namespace antipode
