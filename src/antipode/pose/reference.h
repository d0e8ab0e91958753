#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <torch/torch.h>

#include "antipode/object/object_view.h"
#include "antipode/prior/object_prior.h"
#include "antipode/synthesis/view_synthesizer.h"

namespace antipode {

/// Which model's codes a reference holds: they mean nothing to another one.
struct PriorIdentity {
  std::string sha256;
};

/// An object known from all sides: posed views and what the networks make of them, so that many queries can be answered
/// (the paper's section 3.2). All lengths are in one unit, the object radii of the views.
struct Reference {
  std::vector<SynthesizedView> views;
  std::vector<ObjectView> crops;  ///< of `views`, for matching
  /// Pose of the photograph that the views were imagined from; nothing if they come from a mesh alone. Then a query's pose
  /// is that of the object.
  std::optional<Rigid3> source_from_object;
  torch::Tensor code;             ///< the views' codes joined, see ObjectPrior::JoinViews
  std::vector<std::string> warnings;

  /// Rotation crop_from_object of a view.
  Eigen::Matrix3d CropRotation(std::size_t view) const {
    return crops[view].crop_from_camera * views[view].camera_from_object.rotation;
  }
};

/// Crops the views and encodes them. Views without an object are left out, with a warning.
/// @throws Error if fewer than eight views are left
Reference MakeReference(std::vector<SynthesizedView> views, const ObjectPrior& prior,
                        const std::optional<Rigid3>& source_from_object = {}, const ProgressCallback& progress = {});

/// Pixels that differ from white by more than 5 in some channel, holes filled: 8UC1, 0 or 255.
cv::Mat MaskOnWhite(const cv::Mat& picture);

/// What a folder with a reference says of itself.
struct ReferenceInfo {
  std::string antipode_version, fingerprint, prior_sha256;
  int views = 0;
  std::optional<Rigid3> source_from_object;
  std::vector<std::string> warnings;
};

/// Writes reference.json and features.safetensors beside the views, which `ViewFolder` has written; reference.json last,
/// so that an interrupted build leaves no reference.
/// @param fingerprint of picture or mesh, mask, camera, models and options
void SaveReference(const std::filesystem::path& folder, const Reference& reference, const PriorIdentity& prior,
                   const std::string& fingerprint);

bool IsReferenceFolder(const std::filesystem::path& folder);

/// @throws BadFile if it is missing, damaged or of another version
ReferenceInfo ReadReferenceInfo(const std::filesystem::path& folder);

/// Verifies every file by its hash.
/// @throws BadFile naming the file that is damaged, or if the features are another model's; each says to build it again
Reference LoadReference(const std::filesystem::path& folder, const PriorIdentity& prior);

}  // namespace antipode
