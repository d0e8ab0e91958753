#include "antipode/prior/posterior.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Dense>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/so3_grid.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kMaxNewtonSteps = 12;
constexpr double kConvergedStep = 1e-7;  // radians
constexpr double kLongestStep = 0.15;    // radians, inside one lobe of a band-limited score

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
      grid_(SuperFibonacciRotations(grid_size)),
      grid_wigner_(WignerMatrices(grid_, max_degree)) {
  for (int l = 0; l <= max_degree; ++l) generators_.push_back(WignerGenerators(l));
}

double RotationPosterior::Score(const Eigen::VectorXf& correlation,
                                const Eigen::Matrix3d& rotation) const {
  return correlation.cast<double>().dot(WignerMatrices(rotation, max_degree_));
}

Eigen::Matrix3d RotationPosterior::Maximize(const Eigen::VectorXf& correlation,
                                            const Eigen::Matrix3d& start) const {
  Eigen::Matrix3d rotation = start;
  double score = Score(correlation, rotation);
  double trust = kLongestStep;
  for (int step = 0; step < kMaxNewtonSteps; ++step) {
    // With R = exp([w]) R0: s(w) = s + g.w + w.H w / 2, g_a = <C, G_a D>, H_ab = sym <C, G_a G_b D>.
    const Eigen::VectorXd wigner = WignerMatrices(rotation, max_degree_);
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    for (int l = 1; l <= max_degree_; ++l) {
      const int size = 2 * l + 1;
      const Eigen::Map<const RowMajorMatrixXf> block(correlation.data() + WignerOffset(l), size, size);
      const Eigen::MatrixXd product = block.cast<double>() * WignerBlock(wigner, l).transpose();
      for (int a = 0; a < 3; ++a) {
        gradient[a] += product.cwiseProduct(generators_[l][a]).sum();
        const Eigen::MatrixXd turned = generators_[l][a].transpose() * product;
        for (int b = 0; b < 3; ++b) hessian(a, b) += turned.cwiseProduct(generators_[l][b]).sum();
      }
    }
    hessian = (0.5 * (hessian + hessian.transpose())).eval();
    const Eigen::LLT<Eigen::Matrix3d> factor(-hessian);
    Eigen::Vector3d move = factor.info() == Eigen::Success ? Eigen::Vector3d(factor.solve(gradient))
                                                           : Eigen::Vector3d(gradient.normalized() * trust);
    if (move.norm() > trust) move *= trust / move.norm();
    const Eigen::Matrix3d candidate = RotationFromVector(move) * rotation;
    const double candidate_score = Score(correlation, candidate);
    if (candidate_score < score) {
      trust = 0.25 * move.norm();
      if (trust < kConvergedStep) break;
      continue;
    }
    rotation = candidate;
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
  return {grid_, GridWeights(CheckedGridScores(correlation, options))};
}

std::vector<RotationMode> RotationPosterior::FindModes(const Eigen::VectorXf& correlation,
                                                       const PosteriorOptions& options) const {
  const Eigen::VectorXf scores = CheckedGridScores(correlation, options);
  const Eigen::VectorXd weights = GridWeights(scores);

  std::vector<int> order(grid_.size());
  std::iota(order.begin(), order.end(), 0);
  // Only rotations that could carry a reportable mode are candidates; the rest need not be sorted.
  const auto candidates = std::min<std::size_t>(order.size(), 2000);
  std::partial_sort(order.begin(), order.begin() + candidates, order.end(),
                    [&](int a, int b) { return scores[a] > scores[b]; });

  // Peaks are sought among more grid maxima than asked for: the one with the most mass comes first.
  const double separation_trace = TraceAtAngle(options.separation_deg);
  const double foothill_trace = TraceAtAngle(options.separation_deg / 2);
  const std::size_t wanted = 2 * static_cast<std::size_t>(options.max_modes) + 2;
  std::vector<RotationMode> modes;
  std::vector<const Eigen::Matrix3d*> climbed;
  for (std::size_t i = 0; i < candidates && modes.size() < wanted; ++i) {
    const Eigen::Matrix3d& start = grid_[order[i]];
    const auto near = [&](const Eigen::Matrix3d& rotation) {
      return std::any_of(modes.begin(), modes.end(), [&](const RotationMode& mode) {
        return TraceOfDifference(mode.rotation, rotation) > separation_trace;
      });
    };
    // The foothills of a peak lead to the same peak: one climb for each is enough.
    const bool is_foothill = std::ranges::any_of(climbed, [&](const Eigen::Matrix3d* other) {
      return TraceOfDifference(*other, start) > foothill_trace;
    });
    if (is_foothill || near(start)) continue;
    climbed.push_back(&start);
    const Eigen::Matrix3d peak = Maximize(correlation, start);
    if (near(peak)) continue;
    modes.push_back({peak, 0, Score(correlation, peak) / options.temperature});
  }

  const double mass_trace = TraceAtAngle(options.mass_radius_deg);
  for (std::size_t g = 0; g < grid_.size(); ++g) {
    RotationMode* nearest = nullptr;
    double nearest_trace = mass_trace;
    for (RotationMode& mode : modes) {
      const double trace = TraceOfDifference(mode.rotation, grid_[g]);
      if (trace < nearest_trace) continue;
      nearest = &mode;
      nearest_trace = trace;
    }
    if (nearest != nullptr) nearest->probability += weights[g];
  }
  std::stable_sort(modes.begin(), modes.end(), [](const RotationMode& a, const RotationMode& b) {
    return a.probability > b.probability;
  });
  KeepReportable(modes, options);
  return modes;
}

}  // namespace antipode
