#pragma once

#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "antipode/prior/object_prior.h"

namespace antipode {

/// One pair of views of validation objects, as the prior sees it.
struct CodedPair {
  torch::Tensor reference, query;  ///< codes, see ObjectPrior::Encode
  Eigen::Matrix3d query_from_reference = Eigen::Matrix3d::Identity();  ///< true rotation between the crop cameras, of one object
};

struct CodedPairs {
  std::vector<CodedPair> same_object;
  std::vector<CodedPair> different_objects;

  void Append(CodedPairs more);
};

/// The pairs of a folder or pack of meshes (MeshCollection) by the protocol of object_protocol.h, every camera rolled by up to
/// `in_plane_rotation_deg`; and the reference view of each object with the queries of the next one.
CodedPairs EncodePairs(const ObjectPrior& prior, const std::filesystem::path& objects, double in_plane_rotation_deg);

/// Rotation accuracy in percent of pairs.
struct RotationAccuracy {
  double within_15 = 0;
  double within_30 = 0;
};
RotationAccuracy MeasureAccuracy(const ObjectPrior& prior, const std::vector<CodedPair>& pairs);

/// Makes the probabilities honest on these pairs: the temperature that maximises the likelihood of the true rotations;
/// with a second stage, the weights of both stages that maximise the likelihood of the mode nearest to the truth; then a
/// logistic regression of "error below 30 degrees" on the best mode's log odds and score.
/// Pairs of different objects count as errors, each as 0.3 of a pair: users mean to compare the same object.
PriorCalibration FitCalibration(const ObjectPrior& prior, const CodedPairs& pairs);

/// Calibrates a stored prior on the pairs of a folder of meshes, level and rolled by up to 45 degrees.
/// @param folder as `antipode train prior` wrote it
void CalibrateModel(const std::filesystem::path& folder, const std::filesystem::path& objects);

}  // namespace antipode
