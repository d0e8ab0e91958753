#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <torch/torch.h>

#include "antipode/object/object_view.h"
#include "antipode/prior/level_cameras.h"
#include "antipode/prior/mode_ranker.h"
#include "antipode/prior/object_encoder.h"
#include "antipode/prior/posterior.h"

namespace antipode {

/// Where a prior's file holds the second stage; everything else is the encoder's.
inline constexpr char kRankerPrefix[] = "ranker.";

/// A prior's file with the encoder's tensors alone; its metadata as it was.
TensorFile WithoutRanker(TensorFile file);

/// Images as the encoder takes them: [N, 3, S, S], RGB in 0..1.
/// @throws Error if a view is not `size` pixels wide
torch::Tensor EncoderInput(std::span<const ObjectView> views, int size);

/// What makes the probabilities of a trained prior honest; fitted on validation objects, stored in the
/// model's metadata.
struct PriorCalibration {
  double temperature = 1;         ///< of the posterior; `PosteriorOptions::temperature` multiplies it
  /// With a second stage: the new log probability of a mode is mode_weight * (its old one) + ranker_weight * (its log
  /// weight), up to a constant.
  double mode_weight = 1;
  double ranker_weight = 1;
  /// confidence = sigmoid(slope * logit(probability) + score_weight * score + offset), of the best mode
  double confidence_slope = 1;
  double confidence_score_weight = 0;
  double confidence_offset = 0;

  std::map<std::string, std::string> ToMetadata() const;
  /// Entries that are missing keep their defaults. @throws BadFile if one is malformed
  static PriorCalibration FromMetadata(const std::map<std::string, std::string>& metadata,
                                       const std::string& file);
};

/// Gives the modes the probabilities that the second stage suggests, p_k' ~ p_k^mode_weight exp(ranker_weight w_k) with
/// the same sum, and sorts them. For level cameras they are multiplied by their density to the power of 0.6, too.
/// Every mode's `reweighting` becomes p_k' / p_k.
void Reweigh(std::vector<RotationMode>& modes, const PriorCalibration& calibration, CameraRoll roll = CameraRoll::kAny);

/// The built-in prior: codes of object-centric images, and the posterior over the rotation between two. Most priors
/// have a second stage (mode_ranker.h), which weighs the posterior's modes anew.
class ObjectPrior {
 public:
  /// From a shipped or imported model ("prior"), or a folder that `antipode train prior` wrote.
  /// @throws BadFile naming the model file and what is wrong with it
  static ObjectPrior Load(const std::string& model_or_folder, torch::Device device = torch::kCPU);

  ObjectPrior(ObjectEncoder encoder, torch::Device device, const PriorCalibration& calibration = {},
              ModeRanker ranker = nullptr);

  /// Crops must be made with these options.
  ObjectViewOptions ViewOptions() const;

  /// Each image is seen twice, as it is and mirrored: the network was trained on mirrored objects too, and its
  /// errors on both differ. The mirrored code is mirrored back and appended as further channels.
  /// @return [N, 2 C, (L + 1)^2], on the CPU
  torch::Tensor Encode(std::span<const ObjectView> views) const;
  torch::Tensor EncodeImages(const torch::Tensor& images) const;  ///< of EncoderInput

  /// The code of an object seen in several posed views: the mean of their codes, each turned into the object's frame,
  /// mean_i D(R_i^T) F_i. Comparing it gives rotations query_crop_from_object.
  /// @param codes [N, 2 C, (L + 1)^2], of Encode
  /// @param crop_from_object R_i
  /// @return [2 C, (L + 1)^2]
  torch::Tensor JoinViews(const torch::Tensor& codes, std::span<const Eigen::Matrix3d> crop_from_object) const;

  /// Peaks of p(query_crop_from_reference_crop), best first.
  /// @param reference_code, query_code [C, (L + 1)^2]
  std::vector<RotationMode> Compare(const torch::Tensor& reference_code, const torch::Tensor& query_code,
                                    PosteriorOptions options = {}, CameraRoll roll = CameraRoll::kAny) const;

  /// Peaks of p(query_crop_from_object), best first, for a code of JoinViews: of the first stage alone, since the second
  /// one was trained on codes of single pictures.
  std::vector<RotationMode> CompareWithJoined(const torch::Tensor& joined_code, const torch::Tensor& query_code,
                                              PosteriorOptions options = {}) const;

  /// The modes before Compare leaves out the less probable ones: at least 8, if there are so many, where there is anything
  /// to weigh them anew by.
  std::vector<RotationMode> WeighedModes(const torch::Tensor& reference_code, const torch::Tensor& query_code,
                                         PosteriorOptions options = {}, CameraRoll roll = CameraRoll::kAny) const;

  /// The modes of the first stage, with the log weights of the second one but not yet weighed by them.
  /// @param options its temperature is that of the posterior; the calibrated one does not matter
  std::vector<RotationMode> Hypotheses(const torch::Tensor& reference_code, const torch::Tensor& query_code,
                                       PosteriorOptions options) const;

  /// The whole posterior, at the calibrated temperature; valid as long as this prior. What lies near a mode shares its
  /// reweighting.
  /// @param modes of WeighedModes
  GridPosterior OnGrid(const torch::Tensor& reference_code, const torch::Tensor& query_code, std::span<const RotationMode> modes) const;

  /// The stacked C_l of a pair (see correlation.h), not yet divided by the temperature.
  Eigen::VectorXf Correlation(const torch::Tensor& reference_code, const torch::Tensor& query_code) const;

  const RotationPosterior& posterior() const { return *posterior_; }
  const PriorCalibration& calibration() const { return calibration_; }
  bool HasSecondStage() const { return !ranker_.is_empty(); }

  /// How often the best rotation is within 30 degrees of the truth: a logistic function of the log odds and the
  /// score of its mode, fitted on validation objects; part of the model. The probability tells how much better
  /// the mode is than other rotations; the score, whether the two images look like one object at all.
  double Confidence(const RotationMode& best) const;

 private:
  ObjectEncoder encoder_;
  ModeRanker ranker_;
  torch::Device device_;
  PriorCalibration calibration_;
  torch::Tensor mirror_signs_;  // [(L + 1)^2]
  std::shared_ptr<const RotationPosterior> posterior_;
};

}  // namespace antipode
