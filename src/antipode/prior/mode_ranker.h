#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include <torch/torch.h>

#include "antipode/prior/posterior.h"

namespace antipode {

struct ModeRankerConfig {
  int max_degree = 8;  ///< L of the codes
  int channels = 64;   ///< C of the codes, both halves
  int points = 64;     ///< of the sphere at which the codes are compared
  int width = 32;      ///< what is kept of the C functions at a point
  int hidden = 96;
  void Check() const;

  std::map<std::string, std::string> ToMetadata() const;
  /// @throws BadFile naming `file` and the missing or malformed entry
  static ModeRankerConfig FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file);
};

/// The prior's second stage: looks at both codes together under a hypothetical rotation and says how well they agree.
/// The correlation of the first stage (correlation.h) weighs all of the sphere alike; this network knows which side of
/// the object each camera has seen, and which differences matter.
///
/// At points x of the query's sphere, with f the code's functions scaled to a mean square of 1,
///   q = E f_query(x),  r = E f_reference(R^T x),
///   h = relu(A [|q - r|, q r] + P [x, R^T x]),  h' = relu(h + B h),
/// and the answer is a perceptron of the mean and the maximum of h' over the points.
class ModeRankerImpl : public torch::nn::Module {
 public:
  explicit ModeRankerImpl(const ModeRankerConfig& config = {});

  /// @param reference, query [B, C, (L + 1)^2]
  /// @param query_from_reference [B, K, 3, 3]
  /// @return [B, K], log weights of the rotations
  torch::Tensor forward(const torch::Tensor& reference, const torch::Tensor& query, const torch::Tensor& query_from_reference);

  /// The mean over both directions, reference to query and back, for every mode.
  /// @param reference, query [C, (L + 1)^2]
  std::vector<double> LogWeights(const torch::Tensor& reference, const torch::Tensor& query, std::span<const RotationMode> modes);

  const ModeRankerConfig& config() const { return config_; }

 private:
  ModeRankerConfig config_;
  torch::Tensor points_, harmonics_;  // [P, 3], [P, (L + 1)^2]
  torch::nn::Linear embed{nullptr}, compare{nullptr}, place{nullptr}, mix{nullptr}, judge{nullptr}, log_weight{nullptr};
};
TORCH_MODULE(ModeRanker);

/// Real spherical harmonics (geometry/spherical_harmonics.h) of many unit vectors.
/// @param directions [..., 3]
/// @return [..., (L + 1)^2], float32
torch::Tensor HarmonicsAt(const torch::Tensor& directions, int max_degree);

}  // namespace antipode
