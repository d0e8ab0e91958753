#include "antipode/training/augmentation.h"

#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/image/degradation.h"
#include "antipode/object/object_view.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

double Normal(std::mt19937_64& random) {
  const double radius = std::sqrt(-2 * std::log(1 - UniformIn(random, 0, 1)));
  return radius * std::cos(UniformIn(random, 0, 2 * std::numbers::pi));
}

bool Chance(std::mt19937_64& random, double share) { return UniformIn(random, 0, 1) < share; }

/// First and last covered pixel of every row: enough to bound the mask after any rotation.
std::vector<Eigen::Vector2d> OutlinePoints(const cv::Mat& rgba) {
  std::vector<Eigen::Vector2d> points;
  for (int y = 0; y < rgba.rows; ++y) {
    const cv::Vec4b* row = rgba.ptr<cv::Vec4b>(y);
    int first = 0, last = rgba.cols - 1;
    while (first <= last && row[first][3] <= 125) ++first;
    if (first > last) continue;
    while (row[last][3] <= 125) --last;
    for (const double side : {y + 0.0, y + 1.0}) {
      points.emplace_back(first, side);
      points.emplace_back(last + 1, side);
    }
  }
  return points;
}

cv::Rect2d JitteredBox(const std::vector<Eigen::Vector2d>& points, const AugmentationOptions& options,
                       std::mt19937_64& random) {
  Eigen::Vector2d low = points.front(), high = points.front();
  for (const auto& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const double side = (high - low).maxCoeff();
  const double scale = 1 + UniformIn(random, -options.crop_scale, options.crop_scale);
  const Eigen::Vector2d shift(UniformIn(random, -1, 1), UniformIn(random, -1, 1));
  const Eigen::Vector2d centre = (low + high) / 2 + shift * side * options.crop_shift;
  const Eigen::Vector2d size = (high - low) * scale;
  return {centre.x() - size.x() / 2, centre.y() - size.y() / 2, size.x(), size.y()};
}

void Erode(cv::Mat& rgba, int pixels) {
  cv::Mat alpha;
  cv::extractChannel(rgba, alpha, 3);
  cv::erode(alpha, alpha, cv::Mat::ones(2 * pixels + 1, 2 * pixels + 1, CV_8U));
  rgba.setTo(cv::Scalar(255, 255, 255, 0), alpha < 128);
}

/// A mask that is too large shows a rim of background.
void Dilate(cv::Mat& rgba, int pixels, std::mt19937_64& random) {
  cv::Mat alpha, dilated;
  cv::extractChannel(rgba, alpha, 3);
  cv::dilate(alpha, dilated, cv::Mat::ones(2 * pixels + 1, 2 * pixels + 1, CV_8U));
  const cv::Scalar color(UniformIn(random, 0, 255), UniformIn(random, 0, 255), UniformIn(random, 0, 255), 255);
  rgba.setTo(color, (alpha < 128) & (dilated >= 128));
}

void Blur(cv::Mat& rgba, std::mt19937_64& random) {
  if (Chance(random, 0.5)) {
    cv::GaussianBlur(rgba, rgba, {}, UniformIn(random, 0.4, 1.4));
  } else {
    rgba = MotionBlurred(rgba, UniformIn(random, 1.5, 7), UniformIn(random, 0, 180));
  }
}

void Compress(cv::Mat& rgba, int quality) {
  cv::Mat rgb;
  cv::cvtColor(rgba, rgb, cv::COLOR_RGBA2RGB);
  cv::mixChannels(AfterJpeg(rgb, quality), rgba, {0, 0, 1, 1, 2, 2});
}

void Degrade(cv::Mat& rgba, const AugmentationOptions& options, std::mt19937_64& random) {
  if (Chance(random, options.mask_error_share)) {
    const int pixels = 1 + static_cast<int>(UniformIndex(random, options.mask_error_pixels));
    if (Chance(random, 0.5)) {
      Erode(rgba, (pixels + 1) / 2);
    } else {
      Dilate(rgba, pixels, random);
    }
  }
  if (Chance(random, options.blur_share)) Blur(rgba, random);
  if (Chance(random, options.compression_share)) Compress(rgba, static_cast<int>(UniformIn(random, 15, 70)));
}

/// The picture with a part of the object beyond its border, now and then.
cv::Mat MaybeCutOff(const cv::Mat& rgba, const AugmentationOptions& options, std::mt19937_64& random) {
  if (!Chance(random, options.cut_share)) return rgba;
  cv::Mat alpha, cut = rgba.clone();
  cv::extractChannel(rgba, alpha, 3);
  const auto side = static_cast<PictureSide>(UniformIndex(random, 4));
  const cv::Mat rest = CutOff(alpha, side, UniformIn(random, 0.05, 0.25));
  cut.setTo(cv::Scalar(255, 255, 255, 0), (rest == 0) & (alpha > 0));
  return cut;
}

Eigen::Matrix3f HueAndSaturation(double hue_radians, double saturation) {
  const Eigen::Matrix3d turn =
      RotationFromVector(Eigen::Vector3d::Ones().normalized() * hue_radians);
  const Eigen::Matrix3d grey = Eigen::Matrix3d::Constant(1.0 / 3);
  return (grey + saturation * (turn - grey)).cast<float>();
}

}  // namespace

torch::Tensor OnWhite(const AugmentedView& view) {
  const auto rgba = torch::from_blob(view.rgba.data, {view.rgba.rows, view.rgba.cols, 4}, torch::kByte).permute({2, 0, 1}).to(torch::kFloat) / 255;
  const auto alpha = rgba.slice(0, 3, 4);
  return (rgba.slice(0, 0, 3) * alpha + (1 - alpha)).unsqueeze(0);
}

RollRegime DrawRegime(const AugmentationOptions& options, std::mt19937_64& random) {
  const double draw = UniformIn(random, 0, 1);
  if (draw < options.level_share) return RollRegime::kLevel;
  return draw < options.level_share + options.tilted_share ? RollRegime::kTilted : RollRegime::kAny;
}

double DrawRoll(RollRegime regime, const AugmentationOptions& options, std::mt19937_64& random) {
  switch (regime) {
    case RollRegime::kLevel: return options.level_deviation_deg * Normal(random);
    case RollRegime::kTilted: return UniformIn(random, -options.tilted_deg, options.tilted_deg);
    case RollRegime::kAny: return UniformIn(random, -180, 180);
  }
  return 0;
}

AugmentedView AugmentView(const ViewCache& cache, int group, int view, double roll_deg, bool mirrored,
                          int image_size, const AugmentationOptions& options, std::mt19937_64& random) {
  const cv::Mat source = MaybeCutOff(cache.Image(group, view), options, random);
  const double centre = cache.image_size() / 2.0, focal = cache.FocalLength(group, view);
  const PinholeCamera camera{cache.image_size(), cache.image_size(), focal, focal, centre, centre};
  const Eigen::Matrix3d roll = RotationAboutZ(RadiansFromDegrees(roll_deg));

  std::vector<Eigen::Vector2d> outline = OutlinePoints(source);
  if (outline.empty()) outline = {{0, 0}, {2 * centre, 2 * centre}};
  const Eigen::Vector2d middle(centre, centre);
  for (auto& point : outline) point = roll.topLeftCorner<2, 2>() * (point - middle) + middle;
  const ObjectCrop crop = LookAtBox(camera, JitteredBox(outline, options, random), {image_size, 0.05});

  const Eigen::Matrix3d turn = crop.crop_from_camera * roll;
  const Eigen::Matrix3d homography = CropHomography(camera, {crop.camera, turn});
  AugmentedView result;
  cv::warpPerspective(source, result.rgba, HomographyForOpenCv(homography), {image_size, image_size}, cv::INTER_LINEAR, cv::BORDER_CONSTANT,
                      cv::Scalar(255, 255, 255, 0));
  Degrade(result.rgba, options, random);
  result.camera_from_object = Rigid3{turn, Eigen::Vector3d::Zero()} * cache.CameraFromObject(group, view);
  result.focal_length = crop.camera.fx;
  if (mirrored) {
    cv::flip(result.rgba, result.rgba, 1);
    const Eigen::Vector3d flip(-1, 1, 1);
    result.camera_from_object = {flip.asDiagonal() * result.camera_from_object.rotation * flip.asDiagonal(),
                                 flip.asDiagonal() * result.camera_from_object.translation};
  }
  return result;
}

AugmentedView PlainView(const ViewCache& cache, int group, int view, int image_size) {
  std::mt19937_64 unused;
  const AugmentationOptions none{.crop_shift = 0, .crop_scale = 0, .mask_error_share = 0, .blur_share = 0, .compression_share = 0, .cut_share = 0};
  return AugmentView(cache, group, view, /*roll_deg=*/0, /*mirrored=*/false, image_size, none, unused);
}

torch::Tensor AugmentColors(const torch::Tensor& rgba, int groups, const AugmentationOptions& options,
                            std::uint64_t seed) {
  const auto count = rgba.size(0);
  const auto views = count / groups;
  std::mt19937_64 random(seed);
  auto matrices = torch::empty({count, 3, 3});
  auto gammas = torch::empty({count, 1, 1, 1});
  std::vector<std::int64_t> noisy;
  std::vector<float> deviations;  // of the noisy ones
  for (std::int64_t group = 0; group < groups; ++group) {
    Eigen::Matrix3f group_matrix = HueAndSaturation(0, UniformIn(random, 0.7, 1.2));
    if (Chance(random, options.recolor_share))
      group_matrix = HueAndSaturation(UniformIn(random, -std::numbers::pi, std::numbers::pi), UniformIn(random, 0.2, 1.3));
    for (std::int64_t i = group * views; i < (group + 1) * views; ++i) {
      const double brightness = UniformIn(random, 0.7, 1.25);
      for (int row = 0; row < 3; ++row) {
        const double gain = brightness * UniformIn(random, 0.92, 1.08);
        for (int column = 0; column < 3; ++column)
          matrices.accessor<float, 3>()[i][row][column] = static_cast<float>(gain) * group_matrix(row, column);
      }
      gammas.data_ptr<float>()[i] = static_cast<float>(std::exp(UniformIn(random, -0.35, 0.35)));
      if (!Chance(random, 0.25)) continue;
      noisy.push_back(i);
      deviations.push_back(static_cast<float>(UniformIn(random, 0, 0.04)));
    }
  }
  const auto alpha = rgba.slice(1, 3, 4);
  const auto pixels = rgba.slice(1, 0, 3).flatten(2);
  auto colors = torch::bmm(matrices.to(rgba.device()), pixels).view({count, 3, rgba.size(2), rgba.size(3)});
  colors = colors.clamp(1e-4, 1).pow(gammas.to(rgba.device()));
  auto generator = at::detail::createCPUGenerator(random());
  const auto many = static_cast<std::int64_t>(noisy.size());
  const auto noise = torch::randn({many, 3, rgba.size(2), rgba.size(3)}, generator, torch::kFloat) *
                     torch::tensor(deviations, torch::kFloat).view({many, 1, 1, 1});
  colors.index_add_(0, torch::tensor(noisy, torch::kLong).to(rgba.device()), noise.to(rgba.device()));
  colors = colors.clamp(0, 1);
  return 1 - alpha + alpha * colors;
}

}  // namespace antipode
