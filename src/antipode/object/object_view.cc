#include "antipode/object/object_view.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include "antipode/image/blob.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kMinSize = 8;
constexpr int kMaxSize = 4096;
constexpr double kMaxMargin = 1.0;
/// Soft mask edges reach this far beyond the pixels over one half.
constexpr int kSoftEdge = 2;

/// Source pixels in blocks of `factor` x `factor`, from `origin` on.
struct PixelGrid {
  cv::Point origin;
  cv::Size size;
  int factor = 1;
};

[[noreturn]] void ThrowTooWide() {
  throw Error("camera", "the object spans too wide an angle for a flat picture",
              "check the focal length or field of view and the object's mask");
}

/// R_v = Rx Ry: the turn about y brings the ray into the plane x = 0, the turn about x onto the
/// axis.
Eigen::Matrix3d LookAlong(const Eigen::Vector3d& ray) {
  const double alpha = std::atan2(ray.x(), ray.z());
  const double beta = std::atan2(ray.y(), std::hypot(ray.x(), ray.z()));
  Eigen::Matrix3d about_y, about_x;
  about_y << std::cos(alpha), 0, -std::sin(alpha), 0, 1, 0, std::sin(alpha), 0, std::cos(alpha);
  about_x << 1, 0, 0, 0, std::cos(beta), -std::sin(beta), 0, std::sin(beta), std::cos(beta);
  return about_x * about_y;
}

/// The larger of the box's width and height at depth 1 of the rotated camera, between the middles
/// of opposite edges: the outline of a compact object touches its box there, not in the corners,
/// which perspective pulls outwards far from the principal point (a sphere's distance would be 5 %
/// too short).
double ExtentAtDepth1(const PinholeCamera& camera, const cv::Rect2d& box,
                      const Eigen::Matrix3d& crop_from_camera) {
  const auto seen = [&](double x_fraction, double y_fraction) -> Eigen::Vector2d {
    const Eigen::Vector3d ray = crop_from_camera * camera.Ray({box.x + x_fraction * box.width,
                                                               box.y + y_fraction * box.height});
    if (ray.z() <= 0) ThrowTooWide();
    return ray.hnormalized();
  };
  const double width = seen(1, 0.5).x() - seen(0, 0.5).x();
  const double height = seen(0.5, 1).y() - seen(0.5, 0).y();
  return std::max(width, height);
}

/// A crop pixel that looks backwards would be warped from the mirrored ray.
void CheckSeesOnlyForwards(const ObjectCrop& crop) {
  const double side = crop.camera.width;
  for (const double u : {0.0, side}) {
    for (const double v : {0.0, side}) {
      const Eigen::Vector3d ray = crop.crop_from_camera.transpose() * crop.camera.Ray({u, v});
      if (ray.z() <= 0) ThrowTooWide();
    }
  }
}

/// How many source pixels one crop pixel spans at `centre`: 1 / sqrt|det of the homography's
/// Jacobian|.
double SourcePixelsPerCropPixel(const Eigen::Matrix3d& homography, const Eigen::Vector2d& centre) {
  const double w = homography.row(2).dot(centre.homogeneous());
  return std::sqrt(std::abs(w * w * w / homography.determinant()));
}

/// The whole-number factor that leaves at most a 1.5-fold reduction to the warp.
int ReductionFactor(double source_pixels_per_crop_pixel) {
  return std::max(1, static_cast<int>(std::lround(source_pixels_per_crop_pixel)));
}

/// Blocks over the box and its soft edge. Larger blocks lie symmetrically about the box, partly
/// outside the image if need be, so that its opposite edges are blurred alike.
PixelGrid GridAround(const cv::Rect& box, const cv::Size& image_size, int factor) {
  const cv::Rect with_soft_edge(box.x - kSoftEdge, box.y - kSoftEdge, box.width + 2 * kSoftEdge,
                                box.height + 2 * kSoftEdge);
  if (factor == 1) {
    const cv::Rect region = with_soft_edge & cv::Rect({}, image_size);
    return {region.tl(), region.size(), 1};
  }
  const cv::Size blocks((with_soft_edge.width + factor - 1) / factor,
                        (with_soft_edge.height + factor - 1) / factor);
  const cv::Size excess = blocks * factor - with_soft_edge.size();
  return {with_soft_edge.tl() - cv::Point(excess.width / 2, excess.height / 2), blocks, factor};
}

/// The darkness 255 - colour and the coverage of one block of source pixels, both weighted by the
/// mask.
cv::Vec4b BlockMean(const cv::Mat& image, const cv::Mat& mask, const cv::Rect& block,
                    std::uint64_t full_weight) {
  std::array<std::uint64_t, 4> total{};
  for (int y = block.y; y < block.y + block.height; ++y) {
    const cv::Vec3b* const colour = image.ptr<cv::Vec3b>(y) + block.x;
    const std::uint8_t* const weight = mask.ptr(y) + block.x;
    std::array<std::uint32_t, 4> sum{};
    for (int x = 0; x < block.width; ++x) {
      const std::uint32_t w = weight[x];
      sum[0] += w * (255u - colour[x][0]);
      sum[1] += w * (255u - colour[x][1]);
      sum[2] += w * (255u - colour[x][2]);
      sum[3] += w * 255u;
    }
    for (int c = 0; c < 4; ++c) total[c] += sum[c];
  }
  cv::Vec4b mean;
  for (int c = 0; c < 4; ++c) {
    mean[c] = static_cast<std::uint8_t>((total[c] + full_weight / 2) / full_weight);
  }
  return mean;
}

/// Division by 255, rounded, of a product of two bytes.
std::uint8_t Over255(std::uint32_t product) {
  return static_cast<std::uint8_t>((product + 128 + ((product + 128) >> 8)) >> 8);
}

void CompositeRow(const cv::Vec3b* colour, const std::uint8_t* weight, cv::Vec4b* result,
                  int width) {
  for (int x = 0; x < width; ++x) {
    const std::uint32_t w = weight[x];
    result[x] = {Over255(w * (255u - colour[x][0])), Over255(w * (255u - colour[x][1])),
                 Over255(w * (255u - colour[x][2])), weight[x]};
  }
}

/// The object on black: 8UC4 (255 - R, 255 - G, 255 - B, 255), each times the mask, area-reduced.
/// Zero is then white background, so that a zero border of the warp is white paper.
cv::Mat ReducedDarkness(const cv::Mat& image, const cv::Mat& mask, const PixelGrid& grid) {
  cv::Mat reduced(grid.size, CV_8UC4);
  const auto reduce_rows = [&](const cv::Range& rows) {
    const std::uint64_t full_weight = 255ull * grid.factor * grid.factor;
    for (int y = rows.start; y < rows.end; ++y) {
      cv::Vec4b* const result = reduced.ptr<cv::Vec4b>(y);
      if (grid.factor == 1) {
        const int source_y = grid.origin.y + y;
        CompositeRow(image.ptr<cv::Vec3b>(source_y) + grid.origin.x,
                     mask.ptr(source_y) + grid.origin.x, result, grid.size.width);
        continue;
      }
      for (int x = 0; x < grid.size.width; ++x) {
        const cv::Rect block(grid.origin.x + x * grid.factor, grid.origin.y + y * grid.factor,
                             grid.factor, grid.factor);
        result[x] = BlockMean(image, mask, block & cv::Rect({}, image.size()), full_weight);
      }
    }
  };
  cv::parallel_for_({0, grid.size.height}, reduce_rows, grid.size.area() * grid.factor / 40000.0);
  return reduced;
}

/// The grid's pixels to the source's: p -> factor p + origin, pixel edges at integers.
Eigen::Matrix3d SourceFromGrid(const PixelGrid& grid) {
  Eigen::Matrix3d matrix;
  matrix << grid.factor, 0, grid.origin.x, 0, grid.factor, grid.origin.y, 0, 0, 1;
  return matrix;
}

void CheckInput(const cv::Mat& image, const cv::Mat& mask, const PinholeCamera& camera) {
  if (image.empty() || image.type() != CV_8UC3) {
    throw Error("image", "is empty or not 8-bit RGB", "give an 8-bit picture of three channels");
  }
  if (mask.type() != CV_8UC1 || mask.size() != image.size()) {
    throw Error("mask", "is not an 8-bit picture of the image's size",
                "give a mask of the same width and height as the image");
  }
  camera.Check();
  if (camera.width != image.cols || camera.height != image.rows) {
    throw Error("camera",
                "is for an image of " + std::to_string(camera.width) + " x " +
                    std::to_string(camera.height) + " pixels, the image has " +
                    std::to_string(image.cols) + " x " + std::to_string(image.rows),
                "give the camera of this image");
  }
}

void CheckShowsAnObject(const LargestBlob& blob) {
  if (blob.box.empty()) throw Error("mask", "is empty", "mark the object with values over 125");
  if (blob.fills_image) {
    throw Error("mask", "covers the whole image", "mark only the object with values over 125");
  }
}

}  // namespace

void ObjectViewOptions::Check() const {
  if (size < kMinSize || size > kMaxSize) {
    throw InvalidOption("size", "is " + std::to_string(size), "give 8 to 4096 pixels");
  }
  if (!(margin >= 0 && margin <= kMaxMargin)) {
    throw InvalidOption("margin", "is " + std::to_string(margin), "give a fraction from 0 to 1");
  }
}

ObjectCrop LookAtBox(const PinholeCamera& camera, const cv::Rect2d& box,
                     const ObjectViewOptions& options) {
  camera.Check();
  options.Check();
  if (!(box.width > 0 && box.height > 0)) {
    throw InvalidOption("box", "is empty", "give a box of positive width and height");
  }
  const Eigen::Vector2d centre(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
  const Eigen::Matrix3d crop_from_camera = LookAlong(camera.Ray(centre));
  const double field = ExtentAtDepth1(camera, box, crop_from_camera) * (1 + 2 * options.margin);
  const double focal_length = options.size / field;
  const double half_size = 0.5 * options.size;
  return {{options.size, options.size, focal_length, focal_length, half_size, half_size},
          crop_from_camera};
}

Eigen::Matrix3d CropHomography(const PinholeCamera& camera, const ObjectCrop& crop) {
  return crop.camera.Intrinsics() * crop.crop_from_camera * camera.Intrinsics().inverse();
}

cv::Matx33d HomographyForOpenCv(const Eigen::Matrix3d& homography) {
  Eigen::Matrix3d half_pixel = Eigen::Matrix3d::Identity();
  half_pixel.topRightCorner<2, 1>().setConstant(0.5);
  const Eigen::Matrix3d shifted = half_pixel.inverse() * homography * half_pixel;
  cv::Matx33d matrix;
  cv::eigen2cv(shifted, matrix);
  return matrix;
}

ObjectView MakeObjectView(const cv::Mat& image, const cv::Mat& mask, const PinholeCamera& camera,
                          const ObjectViewOptions& options) {
  CheckInput(image, mask, camera);
  const LargestBlob blob = FindLargestBlob(mask);
  CheckShowsAnObject(blob);

  const ObjectCrop crop = LookAtBox(camera, blob.box, options);
  CheckSeesOnlyForwards(crop);
  const Eigen::Matrix3d homography = CropHomography(camera, crop);
  const Eigen::Vector2d centre(blob.box.x + 0.5 * blob.box.width,
                               blob.box.y + 0.5 * blob.box.height);
  const int factor = ReductionFactor(SourcePixelsPerCropPixel(homography, centre));
  const PixelGrid grid = GridAround(blob.box, image.size(), factor);

  const cv::Mat darkness = ReducedDarkness(image, blob.mask, grid);
  cv::Mat warped;
  cv::warpPerspective(darkness, warped, HomographyForOpenCv(homography * SourceFromGrid(grid)),
                      {options.size, options.size}, cv::INTER_LINEAR, cv::BORDER_CONSTANT);

  ObjectView view;
  view.camera = crop.camera;
  view.crop_from_camera = crop.crop_from_camera;
  view.distance = crop.camera.fx * (1 + 2 * options.margin) / (0.5 * options.size);
  view.warnings = BlobWarnings(blob, image.size());
  cv::cvtColor(warped, view.image, cv::COLOR_BGRA2BGR);
  cv::bitwise_not(view.image, view.image);
  cv::extractChannel(warped, view.mask, 3);
  return view;
}

Rigid3 BetweenCameras(const ObjectView& reference, const ObjectView& query,
                      const Rigid3& query_crop_from_reference_crop) {
  const Eigen::Matrix3d query_camera_from_crop = query.crop_from_camera.transpose();
  return {query_camera_from_crop * query_crop_from_reference_crop.rotation * reference.crop_from_camera,
          query_camera_from_crop * query_crop_from_reference_crop.translation};
}

Rigid3 ComposeFromCrops(const ObjectView& reference, const ObjectView& query,
                        const Eigen::Matrix3d& query_crop_from_reference_crop) {
  const Eigen::Vector3d centre_in_reference_crop(0, 0, reference.distance);
  const Eigen::Vector3d centre_in_query_crop(0, 0, query.distance);
  return BetweenCameras(
      reference, query,
      {query_crop_from_reference_crop,
       centre_in_query_crop - query_crop_from_reference_crop * centre_in_reference_crop});
}

}  // namespace antipode
