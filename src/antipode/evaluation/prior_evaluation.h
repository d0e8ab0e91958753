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

/// The pairs of a folder of meshes by the protocol of object_protocol.h, every camera rolled by up to
/// `in_plane_rotation_deg`.
std::vector<ScoredPair> ScorePairs(const ObjectPrior& prior, const std::filesystem::path& objects,
                                   double in_plane_rotation_deg);

/// Rotation accuracy in percent of pairs.
struct RotationAccuracy {
  double within_15 = 0;
  double within_30 = 0;
};
RotationAccuracy MeasureAccuracy(const ObjectPrior& prior, const std::vector<ScoredPair>& pairs);

/// Makes the probabilities honest on these pairs: the temperature that maximises the likelihood of the
/// true rotations, then a logistic regression of "error below 30 degrees" on the best mode's log odds.
PriorCalibration FitCalibration(const RotationPosterior& posterior, const std::vector<ScoredPair>& pairs);

}  // namespace antipode
