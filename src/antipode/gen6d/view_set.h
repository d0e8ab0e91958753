#pragma once

#include <numbers>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <torch/torch.h>

#include "antipode/gen6d/normalized_view.h"
#include "antipode/gen6d/refiner.h"
#include "antipode/gen6d/selector.h"
#include "antipode/geometry/camera.h"
#include "antipode/util/progress.h"

namespace antipode {

/// How pictures are prepared for the networks. The default is consistent; `Published()` is what the published program
/// does, errors included, for checks against its numbers.
struct ViewMatchingConventions {
  NormalizationOptions normalization;
  NeighbourPool neighbours = NeighbourPool::kAll;
  double border = 255;                             ///< grey level outside turned references and query crops
  double radians_per_angle = std::numbers::pi / 2;  ///< of the selector's angles

  static ViewMatchingConventions Published();
};

/// A picture of the object whose pose is known. Pixel centres at integers; the object's diameter is 2.
struct PosedPicture {
  cv::Mat rgb;  ///< 8UC3, white background
  Eigen::Matrix3d intrinsics;
  Rigid3 camera_from_object;
};

/// A picture whose object pose is sought.
struct QueryPicture {
  cv::Mat rgb;  ///< 8UC3, white background
  Eigen::Matrix3d intrinsics;
};

/// K with pixel centres at integers.
Eigen::Matrix3d IntegerIntrinsics(const PinholeCamera& camera);

/// The pose in the networks' object frame, +Z up, of one with +Y up.
Rigid3 ToCanonicalFrame(const Rigid3& camera_from_object);

/// From the product's conventions: pixel centres at integer + 0.5, object frame with +Y up, unit radius.
PosedPicture ToPosedPicture(const cv::Mat& rgb, const PinholeCamera& camera, const Rigid3& camera_from_object);

/// [N, 3, H, W] in [0, 1].
torch::Tensor ToImages(const std::vector<cv::Mat>& pictures);

/// A picture warped by a homography (source to target pixel), bilinear, with a constant border.
cv::Mat WarpPicture(const cv::Mat& picture, const Eigen::Matrix3d& target_from_source, int size, double border);

/// The query as the selector sees it.
cv::Mat CropQuery(const cv::Mat& picture, const QueryCrop& crop, const ViewMatchingConventions& conventions);

/// Posed views as the selector sees them, with their features.
struct SelectorReferences {
  std::vector<NormalizedView> views;  ///< upright
  std::vector<cv::Mat> upright;       ///< pictures of `views`
  SelectorFeatures features;          ///< of every view in five in-plane rotations, view-major
  torch::Tensor viewpoints;           ///< [N, 3]
};

/// The view turned by -90, -45, 0, 45 and 90 degrees.
std::vector<cv::Mat> TurnedPictures(const PosedPicture& view, const NormalizedView& upright,
                                    const ViewMatchingConventions& conventions);

/// @param features of these views, if they have been computed before
SelectorReferences PrepareReferences(Selector& selector, const std::vector<PosedPicture>& views,
                                     const ViewMatchingConventions& conventions = {}, SelectorFeatures features = {},
                                     const ProgressCallback& progress = {});

/// The coarse pose that a reference view gives.
struct SelectedPose {
  std::size_t view = 0;
  double logit = 0;
  double angle = 0;  ///< radians, clockwise
  Rigid3 camera_from_object;
};

/// All views with the poses they give, best first.
std::vector<SelectedPose> SelectViews(Selector& selector, const SelectorReferences& references, const QueryPicture& query,
                                      const QueryCrop& crop, const ViewMatchingConventions& conventions = {});

PosedCamera CameraOf(const NormalizedView& view);
std::vector<PosedCamera> CamerasOf(const std::vector<NormalizedView>& views);

/// One refinement step's pictures and cameras.
struct RefinementInput {
  NormalizedView query;
  cv::Mat query_picture;
  std::vector<std::size_t> views;
  std::vector<NormalizedView> references;
  std::vector<cv::Mat> reference_pictures;
};
RefinementInput PrepareRefinement(const std::vector<PosedPicture>& views, const QueryPicture& query,
                                  const Rigid3& camera_from_object, const ViewMatchingConventions& conventions = {});

/// What the network says of prepared inputs, all in one batch.
std::vector<PoseChange> PredictChanges(Refiner& refiner, const std::vector<RefinementInput>& inputs);

/// `iterations` steps from every start, all starts in one batch.
/// @return for every start the poses after 0, 1, .. iterations
std::vector<std::vector<Rigid3>> RefinePoses(Refiner& refiner, const std::vector<PosedPicture>& views, const QueryPicture& query,
                                             const std::vector<Rigid3>& starts, int iterations,
                                             const ViewMatchingConventions& conventions = {});

}  // namespace antipode
