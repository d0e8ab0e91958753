#pragma once

#include <string>
#include <vector>

#include <torch/torch.h>

#include "antipode/matching/feature_matches.h"
#include "antipode/matching/local_features.h"
#include "antipode/weights/safetensors.h"

namespace antipode {

/// Sizes of a LightGlue network, and when it stops early.
struct LightGlueConfig {
  int input_size = 128;       ///< of the descriptors that come in
  int descriptor_size = 256;  ///< inside the network
  int layers = 9;
  int heads = 4;
  /// Stops after a layer in which more than this share of the points is sure of its state;
  /// negative: never.
  double depth_confidence = 0.95;
  /// Drops points whose probability to have a match is at most 1 minus this (if their state is
  /// sure, where `depth_confidence` is in use); negative: none.
  double width_confidence = 0.99;
  double filter_threshold = 0.1;  ///< matches need a higher score

  void Check() const;  ///< @throws InvalidOption

  static LightGlueConfig ForAliked();
  static LightGlueConfig LighterGlue();  ///< the smaller network for XFeat
};

/// What `LightGlueImpl::Match` found.
struct LightGlueMatches {
  FeatureMatches matches;  ///< scores are probabilities
  int layers = 0;          ///< how many layers ran
};

/// What one layer says of every pair of points.
struct LightGlueAssignment {
  torch::Tensor log_probability;         ///< [M, N], that they match
  torch::Tensor reference_matchability;  ///< [M], log odds of having a match
  torch::Tensor query_matchability;      ///< [N]
};

/// LightGlue (Lindenberger, Sarlin and Pollefeys, "LightGlue: Local Feature Matching at Light
/// Speed", ICCV 2023): layers of self-attention with rotary position encoding and of
/// cross-attention between the images, then an assignment by the product of both softmaxes and of
/// both points' probability to have a match. Parameters are named as in the published checkpoints.
class LightGlueImpl : public torch::nn::Module {
 public:
  explicit LightGlueImpl(const LightGlueConfig& config);

  /// Derives from the parameters what `Match` uses. To be called again when they or their device
  /// change.
  void Prepare();

  /// @param reference,query with descriptors of `input_size`; on the device of the parameters
  /// @throws Error if `Prepare` was not called, or descriptors have another size
  LightGlueMatches Match(const LocalFeatures& reference, const LocalFeatures& query) const;

  /// For training: of every layer, without leaving out points; gradients reach the parameters, and `Prepare` is not needed.
  std::vector<LightGlueAssignment> Assignments(const LocalFeatures& reference, const LocalFeatures& query) const;

 private:
  struct FeedForward {
    torch::nn::Linear expand{nullptr};
    torch::nn::LayerNorm norm{nullptr};
    torch::nn::Linear project{nullptr};
  };
  struct Layer {
    torch::nn::Linear self_projection{nullptr}, self_output{nullptr};
    torch::nn::Linear cross_key{nullptr}, cross_value{nullptr}, cross_output{nullptr};
    FeedForward self_update, cross_update;
  };
  struct Assignment {
    torch::nn::Linear matchability{nullptr}, projection{nullptr};
  };
  struct Affine {
    torch::Tensor weight, bias;
  };
  /// x + project(gelu(norm(from_token x + from_context c + bias))) for the context c that attention
  /// gathered.
  struct Update {
    torch::Tensor from_token, from_context, bias;
    FeedForward layers;
  };
  struct PreparedLayer {
    Affine self_projection, cross_projection;
    Update self_update, cross_update;
  };
  struct Tokens;

  torch::nn::Linear MakeLinear(const std::string& name, int in_size, int out_size,
                               bool with_bias = true);
  FeedForward MakeFeedForward(const std::string& name);
  std::vector<PreparedLayer> PreparedLayers() const;
  Affine PrepareSelfProjection(const torch::nn::Linear& projection) const;
  static Update PrepareUpdate(const torch::nn::Linear& output, const FeedForward& layers);
  static void Apply(const Update& update, const torch::Tensor& context, Tokens& tokens);

  Tokens Embed(const LocalFeatures& reference, const LocalFeatures& query) const;
  void AttendToSelf(const PreparedLayer& layer, Tokens& tokens) const;
  void AttendToOther(const PreparedLayer& layer, Tokens& tokens) const;
  torch::Tensor Attend(const torch::Tensor& queries, const torch::Tensor& keys,
                       const torch::Tensor& values) const;
  float SureFrom(int layer) const;
  void DropUnmatchable(int layer, const torch::Tensor& confidence, Tokens& tokens) const;
  LightGlueAssignment AssignmentOf(int layer, const Tokens& tokens) const;
  LightGlueMatches Assign(int layer, const Tokens& tokens) const;

  LightGlueConfig config_;
  torch::nn::Linear input_{nullptr}, position_{nullptr};
  std::vector<Layer> layers_;
  std::vector<Assignment> assignments_;
  std::vector<torch::nn::Linear> confidences_;
  std::vector<PreparedLayer> prepared_;
};
TORCH_MODULE(LightGlue);

/// @param weights named as in the checkpoints
/// @param source the file or model, for messages
/// @return prepared
/// @throws BadFile if a tensor is missing, extra or of another shape
LightGlue LoadLightGlue(const LightGlueConfig& config, const TensorFile& weights,
                        const std::string& source, torch::Device device);

}  // namespace antipode
