#include "antipode/training/matching_pairs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/object/object_view.h"
#include "antipode/pose/halfway_matching.h"
#include "antipode/render/renderer.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

using torch::Tensor;

constexpr double kSamePoint = 0.013, kNearPoint = 0.035;
constexpr double kGreatestAngleDeg = 100, kGreatestRollDeg = 60;
constexpr double kWideShare = 0.2, kSmallShare = 0.65, kFarErrorShare = 0.2;
constexpr int kDrawsOfPair = 8;

/// A crop with the surface that it shows.
struct PosedCrop {
  ObjectView crop;
  cv::Mat depth;
  Rigid3 crop_from_object;

  /// Object frame; not a number off the object.
  Eigen::Vector3d SurfaceAt(const Eigen::Vector2d& pixel) const {
    const cv::Point cell(static_cast<int>(std::floor(pixel.x())), static_cast<int>(std::floor(pixel.y())));
    const bool is_inside = cv::Rect({0, 0}, depth.size()).contains(cell);
    const double z = is_inside ? depth.at<float>(cell) : 0;
    if (z <= 0) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
    const PinholeCamera& camera = crop.camera;
    const Eigen::Vector3d in_crop(z * (pixel.x() - camera.cx) / camera.fx, z * (pixel.y() - camera.cy) / camera.fy, z);
    return crop_from_object.rotation.transpose() * (in_crop - crop_from_object.translation);
  }
};

PosedCrop RenderCrop(const Renderer& renderer, double roll_deg, const MatchingPairOptions& options, std::mt19937_64& random) {
  const bool is_wide = UniformIn(random, 0, 1) < kWideShare;
  const Viewpoint viewpoint{.azimuth = UniformIn(random, 0, 360),
                            .elevation = is_wide ? UniformIn(random, -60, 80) : UniformIn(random, -5, 65),
                            .in_plane_rotation = roll_deg,
                            .distance = UniformIn(random, 2.6, 5.5)};
  const RenderOptions light = UniformIn(random, 0, 1) < 0.5 ? RandomLight(random) : RenderOptions{};
  const bool is_small = UniformIn(random, 0, 1) < kSmallShare;
  const int size = static_cast<int>(is_small ? UniformIn(random, 230, 300) : UniformIn(random, 300, options.crop_size));
  // The unit sphere at distance d fills the picture: tan(half angle) = 1 / sqrt(d^2 - 1).
  const double half = size / 2.0, focal_length = half * std::sqrt(viewpoint.distance * viewpoint.distance - 1);
  const PinholeCamera camera{size, size, focal_length, focal_length, half, half};
  const Rigid3 camera_from_object = CameraFromObject(viewpoint);
  const Rendering picture = renderer.Render(camera, camera_from_object, light);
  PosedCrop posed{MakeObjectView(picture.image, picture.mask, camera, {.size = options.crop_size}), {}, {}};
  posed.crop_from_object = Rigid3{posed.crop.crop_from_camera, Eigen::Vector3d::Zero()} * camera_from_object;
  posed.depth = renderer.Render(posed.crop.camera, posed.crop_from_object, {.samples_per_side = 1}).depth;
  return posed;
}

/// @param in_crop from pixels of the image that has the features to those of the crop
template <typename InCrop>
SurfaceFeatures OnSurface(LocalFeatures features, const PosedCrop& posed, const InCrop& in_crop) {
  Tensor points = torch::empty({features.size(), 3});
  const auto keypoints = features.keypoints.accessor<float, 2>();
  auto values = points.accessor<float, 2>();
  for (std::int64_t i = 0; i < features.size(); ++i) {
    const Eigen::Vector3d point = posed.SurfaceAt(in_crop(Eigen::Vector2d(keypoints[i][0], keypoints[i][1])));
    for (int k = 0; k < 3; ++k) values[i][k] = static_cast<float>(point[k]);
  }
  return {std::move(features), std::move(points)};
}

double RollDeg(const Eigen::Matrix3d& b_from_a) {
  return DegreesFromRadians(std::atan2(b_from_a(1, 0) - b_from_a(0, 1), b_from_a(0, 0) + b_from_a(1, 1)));
}

Eigen::Matrix3d RandomError(std::mt19937_64& random) {
  const Eigen::Vector3d axis(UniformIn(random, -1, 1), UniformIn(random, -1, 1), UniformIn(random, -1, 1));
  const double degrees = UniformIn(random, 0, 1) < kFarErrorShare ? UniformIn(random, 20, 60) : UniformIn(random, 0, 20);
  return RotationFromVector(RadiansFromDegrees(degrees) * axis.normalized());
}

class PairMaker {
 public:
  PairMaker(const XFeat& features, std::vector<PosedCrop> crops, std::mt19937_64& random)
      : features_(features), crops_(std::move(crops)), of_crops_(crops_.size()), random_(random) {}

  /// Nothing where the views drawn have too little in common.
  void AddCropPair(std::vector<SurfacePair>& pairs) {
    const auto [a, b] = DrawTwo();
    const Eigen::Matrix3d rotation = Between(a, b);
    if (AngleBetweenAxesDeg(rotation) > kGreatestAngleDeg || std::abs(RollDeg(rotation)) > kGreatestRollDeg) return;
    pairs.push_back({OfCrop(a), OfCrop(b)});
  }

  void AddHalfwayPair(std::vector<SurfacePair>& pairs) {
    const auto [a, b] = DrawTwo();
    const Eigen::Matrix3d rotation = Between(a, b), guess = RandomError(random_) * rotation;
    if (AngleBetweenAxesDeg(rotation) > kGreatestAngleDeg || AngleBetweenAxesDeg(guess) > HalfwayOptions().greatest_angle_deg) return;
    const HalfwayAxes axes = TurnHalfway(guess);
    pairs.push_back({OfHalfway(crops_[a], axes.halfway_from_reference), OfHalfway(crops_[b], axes.halfway_from_query)});
  }

 private:
  std::pair<std::size_t, std::size_t> DrawTwo() {
    const auto two = DrawDistinct<std::size_t>(2, crops_.size(), random_);
    return {two[0], two[1]};
  }
  Eigen::Matrix3d Between(std::size_t a, std::size_t b) const {
    return crops_[b].crop_from_object.rotation * crops_[a].crop_from_object.rotation.transpose();
  }
  const SurfaceFeatures& OfCrop(std::size_t i) {
    if (!of_crops_[i])
      of_crops_[i] = OnSurface(features_.Detect(crops_[i].crop.image), crops_[i], [](const Eigen::Vector2d& pixel) { return pixel; });
    return *of_crops_[i];
  }
  SurfaceFeatures OfHalfway(const PosedCrop& posed, const Eigen::Matrix3d& halfway_from_crop) const {
    const HalfwayView view(posed.crop, halfway_from_crop);
    return OnSurface(features_.Detect(view.Image()), posed, [&](const Eigen::Vector2d& pixel) { return view.InCrop(pixel); });
  }

  const XFeat& features_;
  std::vector<PosedCrop> crops_;
  std::vector<std::optional<SurfaceFeatures>> of_crops_;
  std::mt19937_64& random_;
};

}  // namespace

SurfaceFeatures SurfaceFeatures::Select(const Tensor& indices) const {
  return {{features.keypoints.index_select(0, indices), features.descriptors.index_select(0, indices),
           features.scores.index_select(0, indices), features.image_size},
          points.index_select(0, indices)};
}

TrueMatches MatchSurfaces(const SurfaceFeatures& reference, const SurfaceFeatures& query) {
  const torch::NoGradGuard no_gradient;
  constexpr double kFarAway = 100;  // in opposite directions, so that what is on nothing is near nothing
  const Tensor distances = torch::cdist(torch::nan_to_num(reference.points, kFarAway), torch::nan_to_num(query.points, -kFarAway));
  const auto [of_reference, nearest_query] = distances.min(1);
  const auto [of_query, nearest_reference] = distances.min(0);
  const Tensor rows = torch::arange(distances.size(0), torch::kLong);
  const Tensor is_match = (nearest_reference.index_select(0, nearest_query) == rows).logical_and(of_reference < kSamePoint);
  const Tensor matched = is_match.nonzero().squeeze(1);
  return {matched, nearest_query.index_select(0, matched), of_reference > kNearPoint, of_query > kNearPoint};
}

void MatchingPairOptions::Check() const {
  if (views < 2) throw InvalidOption("views", "leaves no pair", "use at least 2");
  if (crop_pairs < 0 || halfway_pairs < 0 || crop_pairs + halfway_pairs < 1) throw InvalidOption("pairs", "must be at least 1");
  if (crop_size < 320 || crop_size > 2048) throw InvalidOption("crop_size", "is " + std::to_string(crop_size), "use 320 to 2048");
}

std::vector<SurfacePair> RenderMatchingPairs(const XFeat& features, const Mesh& mesh, const MatchingPairOptions& options,
                                             std::mt19937_64& random) {
  options.Check();
  const Renderer renderer(mesh);
  const double roll = UniformIn(random, 0, 1) < options.rolled_share ? options.greatest_roll_deg : 5;
  std::vector<PosedCrop> crops;
  for (int i = 0; i < options.views; ++i) crops.push_back(RenderCrop(renderer, UniformIn(random, -roll, roll), options, random));
  PairMaker maker(features, std::move(crops), random);
  std::vector<SurfacePair> pairs;
  const auto add = [&](std::size_t count, auto&& draw) {
    const std::size_t enough = pairs.size() + count;
    for (std::size_t i = 0; i < kDrawsOfPair * count && pairs.size() < enough; ++i) draw();
  };
  add(static_cast<std::size_t>(options.crop_pairs), [&] { maker.AddCropPair(pairs); });
  add(static_cast<std::size_t>(options.halfway_pairs), [&] { maker.AddHalfwayPair(pairs); });
  return pairs;
}

}  // namespace antipode
