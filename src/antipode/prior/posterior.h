#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <torch/torch.h>

#include "antipode/geometry/so3_grid.h"
#include "antipode/geometry/wigner.h"

namespace antipode {

/// A peak of the posterior over relative rotations.
struct RotationMode {
  Eigen::Matrix3d rotation;  ///< query_from_reference
  double probability = 0;    ///< posterior mass within `PosteriorOptions::mass_radius_deg`
  double score = 0;          ///< s(R) / temperature
  double log_weight = 0;     ///< what the second stage says, see mode_ranker.h; 0 without one
  double reweighting = 1;    ///< the factor by which the second stage and known cameras have changed the probability
};

struct PosteriorOptions {
  int max_modes = 5;                 ///< how many peaks to report
  double separation_deg = 30;        ///< peaks nearer to a better one are left out
  double mass_radius_deg = 15;       ///< the ball whose mass is a peak's probability
  double temperature = 1;            ///< p ~ exp(s / temperature); calibrated on validation data
  double least_probability = 0.005;  ///< peaks below are left out, except the best
  void Check() const;
};

/// Leaves the first `max_modes` of sorted modes, and of them the best and those of at least `least_probability`.
void KeepReportable(std::vector<RotationMode>& modes, const PosteriorOptions& options);

/// log p, finite for a peak without mass, too.
double LogProbability(const RotationMode& mode);

/// log(p / (1 - p)), finite for every p in 0..1.
double LogOdds(double probability);

/// 1 / (1 + exp(-x)): the inverse.
double Logistic(double log_odds);

/// The posterior's mass at every rotation of a grid.
struct GridPosterior {
  std::span<const Eigen::Matrix3d> rotations;  ///< query_from_reference
  Eigen::VectorXd weights;                     ///< sum to 1

  /// Mass within `radius_deg` of a rotation.
  double MassAround(const Eigen::Matrix3d& rotation, double radius_deg = 15) const;

  /// Multiplies the mass within `radius_deg` of a rotation.
  void ScaleAround(const Eigen::Matrix3d& rotation, double factor, double radius_deg = 15);
};

/// Evaluates and maximises band-limited scores s(R) = sum_l <C_l, D_l(R)> over SO(3).
class RotationPosterior {
 public:
  /// @param grid_size about how many rotations the grid has, see CubeSymmetricGrid
  explicit RotationPosterior(int max_degree, int grid_size = 21000);

  /// Peaks, best first: grid maxima, refined by Newton's method on SO(3). Their balls are cut where they
  /// overlap (a grid rotation counts for the nearest peak), so the probabilities sum to at most 1.
  /// @param correlation stacked C_l, length WignerSize(max_degree)
  std::vector<RotationMode> FindModes(const Eigen::VectorXf& correlation,
                                      const PosteriorOptions& options = {}) const;

  /// The result refers to this object's grid.
  GridPosterior OnGrid(const Eigen::VectorXf& correlation, const PosteriorOptions& options = {}) const;

  /// s(R) of every rotation of the grid. For R = R_i G_j it is sum_l <C_l D_l(G_j)^T, D_l(R_i)>, so that the Wigner matrices of the
  /// cell serve for all of the grid, and fit in the cache.
  Eigen::VectorXf GridScores(const Eigen::VectorXf& correlation) const;

  double Score(const Eigen::VectorXf& correlation, const Eigen::Matrix3d& rotation) const;

  /// Newton ascent from `start`; falls back to a gradient step where the Hessian is not negative definite.
  Eigen::Matrix3d Maximize(const Eigen::VectorXf& correlation, const Eigen::Matrix3d& start) const;

  int max_degree() const { return max_degree_; }
  const std::vector<Eigen::Matrix3d>& grid() const { return grid_.rotations(); }

 private:
  /// With R = exp([w]) R0: s(w) = s + g.w + w.H w / 2 + .., and P = C D(R0)^T of one degree: g_a = <P, G_a>, H_ab = <P, S_ab>.
  struct Derivatives {
    std::array<Eigen::SparseMatrix<double>, 3> first;   ///< G_a, see WignerGenerators
    std::array<Eigen::SparseMatrix<double>, 6> second;  ///< S_ab = (G_a G_b + G_b G_a) / 2 for xx, xy, xz, yy, yz, zz
  };
  static Derivatives DerivativesOf(int degree);

  /// Newton's step, or one along the gradient where the score is not concave; at most `longest` radians.
  /// @param wigner of the rotation that the step starts from
  Eigen::Vector3d AscentStep(const Eigen::VectorXd& correlation, const Eigen::VectorXd& wigner, double longest) const;

  /// s(R) / temperature of every rotation of the grid. @throws Error if they are not finite, or the degree differs
  Eigen::VectorXf CheckedGridScores(const Eigen::VectorXf& correlation, const PosteriorOptions& options) const;

  /// The rotations of the grid that weigh at least as much as all their neighbours, best first.
  std::vector<Eigen::Matrix3d> LocalMaxima(const Eigen::VectorXd& weights, std::size_t most) const;

  /// Adds the weight of every rotation of the grid to the nearest mode, if that is within the radius.
  void AddMass(const Eigen::VectorXd& weights, double radius_deg, std::vector<RotationMode>& modes) const;

  int max_degree_;
  CubeSymmetricGrid grid_;
  std::vector<std::vector<CubeSymmetricGrid::Element>> neighbours_;  ///< of the rotations of the cell
  torch::Tensor cell_wigner_;                                        ///< [cell, WignerSize]
  std::vector<Eigen::VectorXd> turn_wigner_;                         ///< of the turns
  std::vector<Derivatives> derivatives_;                             ///< of degrees 1..L, at index l - 1
};

}  // namespace antipode
