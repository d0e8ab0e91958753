#include "antipode/prior/mode_ranker.h"

#include <cmath>
#include <numbers>

#include "antipode/geometry/spherical_harmonics.h"
#include "antipode/prior/code_maps.h"
#include "antipode/prior/correlation.h"
#include "antipode/util/error.h"
#include "antipode/weights/metadata_fields.h"

namespace antipode {
namespace {

using torch::Tensor;

constexpr MetadataField<ModeRankerConfig> kFields[] = {
    {"ranker_max_degree", &ModeRankerConfig::max_degree, 1, 16}, {"ranker_channels", &ModeRankerConfig::channels, 1, 1024},
    {"ranker_points", &ModeRankerConfig::points, 4, 4096},       {"ranker_width", &ModeRankerConfig::width, 1, 1024},
    {"ranker_hidden", &ModeRankerConfig::hidden, 1, 4096},
};

/// Fibonacci's spiral: nearly uniform on the unit sphere. [count, 3]
Tensor SpherePoints(int count) {
  auto points = torch::empty({count, 3});
  auto values = points.accessor<float, 2>();
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1.0) / count, radius = std::sqrt(1 - z * z);
    const double angle = 2 * std::numbers::pi * std::numbers::phi * (i + 0.5);
    values[i][0] = static_cast<float>(radius * std::cos(angle));
    values[i][1] = static_cast<float>(radius * std::sin(angle));
    values[i][2] = static_cast<float>(z);
  }
  return points;
}

}  // namespace

void ModeRankerConfig::Check() const {
  CheckFields(kFields, *this);
}

std::map<std::string, std::string> ModeRankerConfig::ToMetadata() const {
  std::map<std::string, std::string> metadata;
  WriteFields(kFields, *this, metadata);
  return metadata;
}

ModeRankerConfig ModeRankerConfig::FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  ModeRankerConfig config;
  ReadFields(kFields, metadata, file, config);
  config.Check();
  return config;
}

Tensor HarmonicsAt(const Tensor& directions, int max_degree) {
  const Tensor rows = directions.to(torch::kCPU, torch::kDouble).reshape({-1, 3}).contiguous();
  const int count = SphericalHarmonicCount(max_degree);
  auto values = torch::empty({rows.size(0), count});
  const double* const from = rows.const_data_ptr<double>();
  float* const to = values.data_ptr<float>();
  for (std::int64_t i = 0; i < rows.size(0); ++i)
    Eigen::Map<Eigen::VectorXf>(to + i * count, count) =
        SphericalHarmonics(Eigen::Map<const Eigen::Vector3d>(from + 3 * i), max_degree).cast<float>();
  std::vector<std::int64_t> shape = directions.sizes().vec();
  shape.back() = count;
  return values.view(shape);
}

ModeRankerImpl::ModeRankerImpl(const ModeRankerConfig& config) : config_(config) {
  config.Check();
  using torch::nn::Linear;
  points_ = SpherePoints(config.points);
  harmonics_ = HarmonicsAt(points_, config.max_degree);
  embed = register_module("embed", Linear(config.channels, config.width));
  compare = register_module("compare", Linear(2 * config.width, config.hidden));
  place = register_module("place", Linear(6, config.hidden));
  mix = register_module("mix", Linear(config.hidden, config.hidden));
  judge = register_module("judge", Linear(2 * config.hidden, 64));
  log_weight = register_module("log_weight", Linear(64, 1));
}

Tensor ModeRankerImpl::forward(const Tensor& reference, const Tensor& query, const Tensor& query_from_reference) {
  const std::int64_t batch = query_from_reference.size(0), modes = query_from_reference.size(1);
  // R^T x without a matrix product, which training would round to bfloat16. [B, K, P, 3]
  const Tensor turned = (points_.unsqueeze(2) * query_from_reference.unsqueeze(2)).sum(3);
  const Tensor of_query = torch::matmul(harmonics_, ScaledCodes(query).transpose(1, 2)).unsqueeze(1);  // [B, 1, P, C]
  // f(R^T x) is the function of the turned code at x. [B, K, P, C]
  const Tensor of_reference = torch::matmul(harmonics_, TurnCodes(ScaledCodes(reference), query_from_reference).transpose(2, 3));
  const Tensor q = embed(of_query), r = embed(of_reference);
  const Tensor where = torch::cat({points_.expand({batch, modes, -1, -1}), turned}, -1);
  const Tensor compared = torch::relu(compare(torch::cat({(q - r).abs(), q * r}, -1)) + place(where));
  const Tensor mixed = torch::relu(compared + mix(compared));
  const Tensor pooled = torch::cat({mixed.mean(2), mixed.amax(2)}, -1);
  return log_weight(torch::relu(judge(pooled))).squeeze(-1).to(torch::kFloat);
}

std::vector<double> ModeRankerImpl::LogWeights(const Tensor& reference, const Tensor& query, std::span<const RotationMode> modes) {
  const torch::InferenceMode inference;
  std::vector<Eigen::Matrix3d> of_modes;
  for (const RotationMode& mode : modes) of_modes.push_back(mode.rotation);
  const Tensor rotations = ToTensor(of_modes).unsqueeze(0);
  const Tensor there = torch::stack({reference, query}), back = torch::stack({query, reference});
  const Tensor both = forward(there, back, torch::cat({rotations, rotations.transpose(2, 3)})).mean(0).to(torch::kDouble).contiguous();
  return {both.const_data_ptr<double>(), both.const_data_ptr<double>() + both.numel()};
}

}  // namespace antipode
