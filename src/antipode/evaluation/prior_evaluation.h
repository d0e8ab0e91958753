#pragma once

#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "antipode/prior/object_prior.h"

namespace antipode {

/// One pair of views of a validation object, as the prior sees it.
struct ScoredPair {
  Eigen::VectorXf correlation;           ///< ObjectPrior::Correlation
  Eigen::Matrix3d query_from_reference;  ///< true rotation between the crop cameras
};

struct ScoredPairs {
  std::vector<ScoredPair> same_object;
  std::vector<Eigen::VectorXf> different_objects;  ///< correlations of views of two objects

  void Append(ScoredPairs more);
};

/// The pairs of a folder of meshes by the protocol of object_protocol.h, every camera rolled by up to
/// `in_plane_rotation_deg`; and the reference view of each object with the queries of the next one.
ScoredPairs ScorePairs(const ObjectPrior& prior, const std::filesystem::path& objects,
                                   double in_plane_rotation_deg);

/// Rotation accuracy in percent of pairs.
struct RotationAccuracy {
  double within_15 = 0;
  double within_30 = 0;
};
RotationAccuracy MeasureAccuracy(const ObjectPrior& prior, const std::vector<ScoredPair>& pairs);

/// Makes the probabilities honest on these pairs: the temperature that maximises the likelihood of the
/// true rotations, then a logistic regression of "error below 30 degrees" on the best mode's log odds and score.
/// Pairs of different objects count as errors, each as 0.3 of a pair: users mean to compare the same object.
PriorCalibration FitCalibration(const RotationPosterior& posterior, const ScoredPairs& pairs);

}  // namespace antipode
