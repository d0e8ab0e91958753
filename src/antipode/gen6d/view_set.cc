#include "antipode/gen6d/view_set.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/geometry/viewpoints.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kWhite = 255;
constexpr std::array<double, Selector::Impl::kAngles> kAnglesDeg{-90, -45, 0, 45, 90};

cv::Mat1d ToMat(const Eigen::Matrix3d& matrix) {
  cv::Mat1d result(3, 3);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) result(row, column) = matrix(row, column);
  return result;
}

/// Rotation of a picture about its middle.
Eigen::Matrix3d TurnAboutMiddle(double angle, int size) {
  Eigen::Matrix3d to_middle = Eigen::Matrix3d::Identity(), back = Eigen::Matrix3d::Identity();
  to_middle.topRightCorner<2, 1>().setConstant(-0.5 * size);
  back.topRightCorner<2, 1>().setConstant(0.5 * size);
  return back * RotationAboutZ(angle) * to_middle;
}

std::vector<Rigid3> PosesOf(const std::vector<PosedPicture>& views) {
  std::vector<Rigid3> poses;
  for (const PosedPicture& view : views) poses.push_back(view.camera_from_object);
  return poses;
}

Eigen::Matrix3d RotationOf(const float* quaternion) {
  return Eigen::Quaterniond(quaternion[0], quaternion[1], quaternion[2], quaternion[3]).normalized().toRotationMatrix();
}

}  // namespace

PosedCamera CameraOf(const NormalizedView& view) { return {view.intrinsics, view.camera_from_object}; }

std::vector<PosedCamera> CamerasOf(const std::vector<NormalizedView>& views) {
  std::vector<PosedCamera> cameras;
  for (const NormalizedView& view : views) cameras.push_back(CameraOf(view));
  return cameras;
}

ViewMatchingConventions ViewMatchingConventions::Published() {
  ViewMatchingConventions conventions;
  conventions.normalization.look_at = LookAtForm::kPublished;
  conventions.neighbours = NeighbourPool::kPublished;
  conventions.border = 0;
  conventions.radians_per_angle = 1;
  return conventions;
}

Eigen::Matrix3d IntegerIntrinsics(const PinholeCamera& camera) {
  Eigen::Matrix3d intrinsics = camera.Intrinsics();
  intrinsics.topRightCorner<2, 1>().array() -= 0.5;
  return intrinsics;
}

Rigid3 ToCanonicalFrame(const Rigid3& camera_from_object) {
  return {camera_from_object.rotation * CanonicalFromObjectRotation().transpose(), camera_from_object.translation};
}

PosedPicture ToPosedPicture(const cv::Mat& rgb, const PinholeCamera& camera, const Rigid3& camera_from_object) {
  return {rgb, IntegerIntrinsics(camera), ToCanonicalFrame(camera_from_object)};
}

torch::Tensor ToImages(const std::vector<cv::Mat>& pictures) {
  std::vector<torch::Tensor> images;
  for (const cv::Mat& picture : pictures) {
    const cv::Mat packed = picture.isContinuous() ? picture : picture.clone();
    images.push_back(torch::from_blob(packed.data, {packed.rows, packed.cols, 3}, torch::kByte).permute({2, 0, 1}).to(torch::kFloat) / 255);
  }
  return at::stack(images);
}

cv::Mat WarpPicture(const cv::Mat& picture, const Eigen::Matrix3d& target_from_source, int size, double border) {
  cv::Mat result;
  cv::warpPerspective(picture, result, ToMat(target_from_source), {size, size}, cv::INTER_LINEAR, cv::BORDER_CONSTANT,
                      cv::Scalar::all(border));
  return result;
}

cv::Mat CropQuery(const cv::Mat& picture, const QueryCrop& crop, const ViewMatchingConventions& conventions) {
  const int size = conventions.normalization.size;
  const double factor = 1 / crop.scale;
  const cv::Matx23d affine(factor, 0, 0.5 * size - factor * crop.position.x(), 0, factor, 0.5 * size - factor * crop.position.y());
  cv::Mat result;
  cv::warpAffine(picture, result, affine, {size, size}, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar::all(conventions.border));
  return result;
}

std::vector<cv::Mat> TurnedPictures(const PosedPicture& view, const NormalizedView& upright,
                                    const ViewMatchingConventions& conventions) {
  const int size = conventions.normalization.size;
  std::vector<cv::Mat> pictures;
  for (const double angle_deg : kAnglesDeg)
    pictures.push_back(WarpPicture(view.rgb, TurnAboutMiddle(RadiansFromDegrees(angle_deg), size) * upright.normalized_pixel_from_pixel,
                                   size, conventions.border));
  return pictures;
}

namespace {

SelectorFeatures FeaturesOfViews(Selector& selector, const std::vector<PosedPicture>& views, const std::vector<NormalizedView>& upright,
                                 const ViewMatchingConventions& conventions, const ProgressCallback& progress) {
  constexpr std::size_t kViewsAtOnce = 8;
  std::vector<SelectorFeatures> batches;
  std::vector<cv::Mat> turned;
  for (std::size_t i = 0; i < views.size(); ++i) {
    std::ranges::move(TurnedPictures(views[i], upright[i], conventions), std::back_inserter(turned));
    if ((i + 1) % kViewsAtOnce != 0 && i + 1 < views.size()) continue;
    batches.push_back(selector->Features(ToImages(turned)));
    turned.clear();
    if (progress) progress({"preparing views", static_cast<std::int64_t>(i + 1), static_cast<std::int64_t>(views.size()), {}});
  }
  SelectorFeatures features;
  for (std::size_t level = 0; level < batches.front().size(); ++level) {
    std::vector<torch::Tensor> parts;
    for (const SelectorFeatures& batch : batches) parts.push_back(batch[level]);
    features.push_back(at::cat(parts));
  }
  return features;
}

}  // namespace

SelectorReferences PrepareReferences(Selector& selector, const std::vector<PosedPicture>& views,
                                     const ViewMatchingConventions& conventions, SelectorFeatures features,
                                     const ProgressCallback& progress) {
  const torch::InferenceMode inference;
  if (views.empty()) throw Error("reference", "has no views");
  SelectorReferences references;
  std::vector<Eigen::Vector3d> centres;
  for (const PosedPicture& view : views) {
    references.views.push_back(NormalizeUpright(view.intrinsics, view.camera_from_object, conventions.normalization));
    references.upright.push_back(WarpPicture(view.rgb, references.views.back().normalized_pixel_from_pixel,
                                             conventions.normalization.size, kWhite));
    centres.push_back(references.views.back().camera_from_object.OriginInSource());
  }
  references.features =
      features.empty() ? FeaturesOfViews(selector, views, references.views, conventions, progress) : std::move(features);
  references.viewpoints = ViewpointVectors(centres, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ());
  return references;
}

std::vector<SelectedPose> SelectViews(Selector& selector, const SelectorReferences& references, const QueryPicture& query,
                                      const QueryCrop& crop, const ViewMatchingConventions& conventions) {
  const torch::InferenceMode inference;
  const SelectorFeatures features = selector->Features(ToImages({CropQuery(query.rgb, crop, conventions)}));
  const SelectorOutput output = selector->forward(features, references.features, references.viewpoints);
  const auto logits = output.logits.accessor<float, 2>()[0], angles = output.angles.accessor<float, 2>()[0];
  std::vector<SelectedPose> poses;
  for (std::size_t i = 0; i < references.views.size(); ++i) {
    const auto index = static_cast<std::int64_t>(i);
    const double angle = angles[index] * conventions.radians_per_angle;
    const NormalizedView& view = references.views[i];
    poses.push_back({i, logits[index], angle,
                     PoseFromSelectedView(crop, angle, view.camera_from_object, view.intrinsics, query.intrinsics,
                                          Eigen::Vector3d::Zero(), conventions.normalization.look_at)});
  }
  std::ranges::stable_sort(poses, std::ranges::greater(), &SelectedPose::logit);
  return poses;
}

RefinementInput PrepareRefinement(const std::vector<PosedPicture>& views, const QueryPicture& query, const Rigid3& camera_from_object,
                                  const ViewMatchingConventions& conventions) {
  const int size = conventions.normalization.size;
  RefinementInput input;
  input.query = NormalizeUnrotated(query.intrinsics, camera_from_object, conventions.normalization);
  input.query_picture = WarpPicture(query.rgb, input.query.normalized_pixel_from_pixel, size, kWhite);
  input.views = NearestViews(PosesOf(views), camera_from_object, Refiner::Impl::kReferences, conventions.neighbours);
  for (const std::size_t index : input.views) {
    const PosedPicture& view = views[index];
    input.references.push_back(NormalizeAligned(view.intrinsics, view.camera_from_object, query.intrinsics, camera_from_object,
                                                conventions.normalization));
    input.reference_pictures.push_back(WarpPicture(view.rgb, input.references.back().normalized_pixel_from_pixel, size, kWhite));
  }
  return input;
}

std::vector<PoseChange> PredictChanges(Refiner& refiner, const std::vector<RefinementInput>& inputs) {
  const torch::InferenceMode inference;
  std::vector<torch::Tensor> queries, references;
  std::vector<PosedCamera> query_cameras;
  std::vector<std::vector<PosedCamera>> reference_cameras;
  for (const RefinementInput& input : inputs) {
    queries.push_back(refiner->Features(ToImages({input.query_picture}))[0]);
    references.push_back(refiner->Features(ToImages(input.reference_pictures)));
    query_cameras.push_back(CameraOf(input.query));
    reference_cameras.push_back(CamerasOf(input.references));
  }
  const RefinerOutput output = refiner->forward(at::stack(queries), query_cameras, at::stack(references), reference_cameras);
  const auto rotation = output.rotation.contiguous(), offset = output.offset.contiguous(), scale = output.scale.contiguous();
  std::vector<PoseChange> changes;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const float* const shift = offset.const_data_ptr<float>() + 2 * i;
    changes.push_back({RotationOf(rotation.const_data_ptr<float>() + 4 * i), std::exp2(scale.const_data_ptr<float>()[i]),
                       {shift[0], shift[1]}});
  }
  return changes;
}

std::vector<std::vector<Rigid3>> RefinePoses(Refiner& refiner, const std::vector<PosedPicture>& views, const QueryPicture& query,
                                             const std::vector<Rigid3>& starts, int iterations,
                                             const ViewMatchingConventions& conventions) {
  std::vector<std::vector<Rigid3>> poses;
  for (const Rigid3& start : starts) poses.push_back({start});
  for (int iteration = 0; iteration < iterations; ++iteration) {
    std::vector<RefinementInput> inputs;
    for (const auto& history : poses) inputs.push_back(PrepareRefinement(views, query, history.back(), conventions));
    const std::vector<PoseChange> changes = PredictChanges(refiner, inputs);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Rigid3 camera_from_normalized{inputs[i].query.normalized_from_camera.transpose(), Eigen::Vector3d::Zero()};
      poses[i].push_back(camera_from_normalized * ApplyChange(changes[i], inputs[i].query.camera_from_object));
    }
  }
  return poses;
}

}  // namespace antipode
