#include "antipode/prior/posterior.h"

#include <algorithm>
#include <cmath>

#include <ATen/Parallel.h>
#include <Eigen/Dense>

#include "antipode/geometry/rotation.h"
#include "antipode/prior/correlation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kMaxNewtonSteps = 12;
constexpr double kConvergedStep = 1e-3;  // radians; Newton's next one would be about its square
constexpr double kLongestStep = 0.15;  // radians, inside one lobe of a band-limited score
constexpr double kRounding = 1e-12;
constexpr double kNeighbourDeg = 10;    // between rotations of the grid, about
constexpr double kLeastWeight = 1e-10;  // of a rotation of the grid that counts; all others weigh less than 3e-6

/// The cosine-like quantity trace(A^T B): monotone in the angle between rotations and cheap.
double TraceOfDifference(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return a.cwiseProduct(b).sum();
}

double TraceAtAngle(double degrees) { return 1 + 2 * std::cos(RadiansFromDegrees(degrees)); }

/// The posterior's mass at every rotation of the grid; sums to 1.
Eigen::VectorXd GridWeights(const Eigen::VectorXf& scores) {
  const Eigen::VectorXd weights = (scores.array() - scores.maxCoeff()).exp().cast<double>();
  return weights / weights.sum();
}

}  // namespace

void PosteriorOptions::Check() const {
  const auto require = [](bool valid, const char* field, const char* remedy) {
    if (!valid) throw InvalidOption(field, "has an impossible value", remedy);
  };
  require(max_modes >= 1, "hypotheses", "use at least 1");
  require(separation_deg > 0 && separation_deg < 180, "separation_deg", "use 0 to 180 degrees");
  require(mass_radius_deg > 0 && mass_radius_deg < 180, "mass_radius_deg", "use 0 to 180 degrees");
  require(temperature > 0 && std::isfinite(temperature), "temperature", "use a positive number");
}

void KeepReportable(std::vector<RotationMode>& modes, const PosteriorOptions& options) {
  if (modes.size() > static_cast<std::size_t>(options.max_modes)) modes.resize(options.max_modes);
  std::erase_if(modes, [&](const RotationMode& mode) {
    return &mode != &modes.front() && mode.probability < options.least_probability;
  });
}

double LogProbability(const RotationMode& mode) { return std::log(std::max(mode.probability, 1e-12)); }

double LogOdds(double probability) {
  const double inside = std::clamp(probability, 1e-6, 1 - 1e-6);
  return std::log(inside / (1 - inside));
}

double Logistic(double log_odds) { return 1 / (1 + std::exp(-log_odds)); }

double GridPosterior::MassAround(const Eigen::Matrix3d& rotation, double radius_deg) const {
  const double least_trace = TraceAtAngle(radius_deg);
  double mass = 0;
  for (std::size_t g = 0; g < rotations.size(); ++g)
    if (TraceOfDifference(rotation, rotations[g]) >= least_trace) mass += weights[static_cast<Eigen::Index>(g)];
  return mass;
}

void GridPosterior::ScaleAround(const Eigen::Matrix3d& rotation, double factor, double radius_deg) {
  const double least_trace = TraceAtAngle(radius_deg);
  for (std::size_t g = 0; g < rotations.size(); ++g)
    if (TraceOfDifference(rotation, rotations[g]) >= least_trace) weights[static_cast<Eigen::Index>(g)] *= factor;
}

RotationPosterior::RotationPosterior(int max_degree, int grid_size)
    : max_degree_(max_degree),
      grid_(grid_size),
      neighbours_(grid_.FindNeighbours(kNeighbourDeg)),
      cell_wigner_(ToTensor(WignerMatrices(grid_.cell(), max_degree))) {
  for (const Eigen::Matrix3d& turn : grid_.turns()) turn_wigner_.push_back(WignerMatrices(turn, max_degree));
  for (int l = 1; l <= max_degree; ++l) derivatives_.push_back(DerivativesOf(l));
}

RotationPosterior::Derivatives RotationPosterior::DerivativesOf(int degree) {
  const std::array<Eigen::MatrixXd, 3> generators = WignerGenerators(degree);
  const auto sparse = [](const Eigen::MatrixXd& matrix) { return Eigen::SparseMatrix<double>(matrix.sparseView(1, kRounding)); };
  Derivatives derivatives;
  for (int a = 0, pair = 0; a < 3; ++a) {
    derivatives.first[a] = sparse(generators[a]);
    for (int b = a; b < 3; ++b)
      derivatives.second[pair++] = sparse(0.5 * (generators[a] * generators[b] + generators[b] * generators[a]));
  }
  return derivatives;
}

Eigen::VectorXf RotationPosterior::GridScores(const Eigen::VectorXf& correlation) const {
  const Eigen::VectorXd scores = correlation.cast<double>();
  RowMajorMatrixXf turned(turn_wigner_.size(), correlation.size());
  for (Eigen::Index j = 0; j < turned.rows(); ++j)
    for (int l = 0; l <= max_degree_; ++l) {
      using RowMajorBlock = Eigen::Map<Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
      RowMajorBlock(turned.row(j).data() + WignerOffset(l), 2 * l + 1, 2 * l + 1) =
          (WignerBlock(scores, l) * WignerBlock(turn_wigner_[j], l).transpose()).cast<float>();
    }
  const torch::InferenceMode inference;
  const torch::Tensor products = torch::matmul(cell_wigner_, ToTensor(turned).t()).contiguous();
  return Eigen::Map<const Eigen::VectorXf>(products.const_data_ptr<float>(), products.numel());
}

double RotationPosterior::Score(const Eigen::VectorXf& correlation,
                                const Eigen::Matrix3d& rotation) const {
  return correlation.cast<double>().dot(WignerMatrices(rotation, max_degree_));
}

Eigen::Vector3d RotationPosterior::AscentStep(const Eigen::VectorXd& correlation, const Eigen::VectorXd& wigner, double longest) const {
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();  // of its upper half
  for (int l = 1; l <= max_degree_; ++l) {
    const Eigen::MatrixXd product = WignerBlock(correlation, l).lazyProduct(WignerBlock(wigner, l).transpose());
    const Derivatives& derivatives = derivatives_[l - 1];
    for (int a = 0, pair = 0; a < 3; ++a) {
      gradient[a] += derivatives.first[a].cwiseProduct(product).sum();
      for (int b = a; b < 3; ++b) hessian(a, b) += derivatives.second[pair++].cwiseProduct(product).sum();
    }
  }
  const Eigen::Matrix3d curvature = -Eigen::Matrix3d(hessian.selfadjointView<Eigen::Upper>());
  const Eigen::LLT<Eigen::Matrix3d> factor(curvature);
  const Eigen::Vector3d step = factor.info() == Eigen::Success ? Eigen::Vector3d(factor.solve(gradient))
                                                               : Eigen::Vector3d(gradient.normalized() * longest);
  return step.norm() > longest ? Eigen::Vector3d(step * (longest / step.norm())) : step;
}

Eigen::Matrix3d RotationPosterior::Maximize(const Eigen::VectorXf& correlation,
                                            const Eigen::Matrix3d& start) const {
  const Eigen::VectorXd scores = correlation.cast<double>();
  Eigen::Matrix3d rotation = start;
  Eigen::VectorXd wigner = WignerMatrices(rotation, max_degree_);
  double score = scores.dot(wigner);
  double longest = kLongestStep;
  for (int step = 0; step < kMaxNewtonSteps; ++step) {
    const Eigen::Vector3d move = AscentStep(scores, wigner, longest);
    const Eigen::Matrix3d candidate = RotationFromVector(move) * rotation;
    const Eigen::VectorXd candidate_wigner = WignerMatrices(candidate, max_degree_);
    const double candidate_score = scores.dot(candidate_wigner);
    if (candidate_score < score) {
      longest = 0.25 * move.norm();
      if (longest < kConvergedStep) break;
      continue;
    }
    rotation = candidate;
    wigner = candidate_wigner;
    score = candidate_score;
    if (move.norm() < kConvergedStep) break;
  }
  return NearestRotation(rotation);
}

Eigen::VectorXf RotationPosterior::CheckedGridScores(const Eigen::VectorXf& correlation,
                                                     const PosteriorOptions& options) const {
  options.Check();
  if (correlation.size() != WignerSize(max_degree_))
    throw Error("rotation posterior", "got a correlation of another degree");
  const Eigen::VectorXf scores = GridScores(correlation) / static_cast<float>(options.temperature);
  if (!scores.allFinite()) throw Error("rotation posterior", "the scores are not finite");
  return scores;
}

GridPosterior RotationPosterior::OnGrid(const Eigen::VectorXf& correlation, const PosteriorOptions& options) const {
  return {grid(), GridWeights(CheckedGridScores(correlation, options))};
}

std::vector<RotationMode> RotationPosterior::FindModes(const Eigen::VectorXf& correlation,
                                                       const PosteriorOptions& options) const {
  const Eigen::VectorXd weights = GridWeights(CheckedGridScores(correlation, options));
  // Peaks are sought among more grid maxima than asked for: the one with the most mass comes first.
  const std::size_t most = 4 * static_cast<std::size_t>(options.max_modes) + 4;
  std::vector<Eigen::Matrix3d> peaks = LocalMaxima(weights, most);
  at::parallel_for(0, static_cast<std::int64_t>(peaks.size()), 1, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) peaks[i] = Maximize(correlation, peaks[i]);
  });
  std::vector<RotationMode> modes;
  const double least_trace = TraceAtAngle(options.separation_deg);
  for (const Eigen::Matrix3d& peak : peaks) {
    const bool is_known = std::ranges::any_of(modes, [&](const RotationMode& mode) { return TraceOfDifference(mode.rotation, peak) > least_trace; });
    if (!is_known) modes.push_back({peak, 0, Score(correlation, peak) / options.temperature});
  }
  AddMass(weights, options.mass_radius_deg, modes);
  std::ranges::stable_sort(modes, std::ranges::greater(), &RotationMode::probability);
  KeepReportable(modes, options);
  return modes;
}

std::vector<Eigen::Matrix3d> RotationPosterior::LocalMaxima(const Eigen::VectorXd& weights, std::size_t most) const {
  std::vector<int> maxima;
  const int cell = static_cast<int>(grid_.cell().size()), turns = static_cast<int>(grid_.turns().size());
  for (int i = 0; i < cell; ++i) {
    for (int j = 0; j < turns; ++j) {
      const int index = grid_.IndexOf(i, j);
      if (weights[index] < kLeastWeight) continue;
      const bool is_highest = std::ranges::none_of(neighbours_[i], [&](const CubeSymmetricGrid::Element& other) {
        return weights[grid_.IndexOf(other.cell, grid_.ProductOf(other.turn, j))] > weights[index];
      });
      if (is_highest) maxima.push_back(index);
    }
  }
  std::ranges::stable_sort(maxima, std::ranges::greater(), [&](int index) { return weights[index]; });
  if (maxima.size() > most) maxima.resize(most);
  std::vector<Eigen::Matrix3d> rotations;
  for (const int index : maxima) rotations.push_back(grid()[index]);
  return rotations;
}

void RotationPosterior::AddMass(const Eigen::VectorXd& weights, double radius_deg, std::vector<RotationMode>& modes) const {
  Eigen::MatrixX4d quaternions(modes.size(), 4);
  for (Eigen::Index k = 0; k < quaternions.rows(); ++k) quaternions.row(k) = QuaternionWxyz(modes[k].rotation).transpose();
  const double least_cosine = std::cos(RadiansFromDegrees(radius_deg / 2));
  for (Eigen::Index g = 0; g < weights.size(); ++g) {
    if (weights[g] < kLeastWeight) continue;
    Eigen::Index nearest = 0;
    const double cosine = quaternions.lazyProduct(grid_.quaternions().col(g)).cwiseAbs().maxCoeff(&nearest);
    if (cosine >= least_cosine) modes[nearest].probability += weights[g];
  }
}

}  // namespace antipode
