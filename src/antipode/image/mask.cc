#include "antipode/image/mask.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

#include "antipode/image/blob.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kObjectAbove = 125;
constexpr char kRemedy[] =
    "pass --reference-mask/--query-mask FILE or --reference-box/--query-box x,y,w,h";

/// GrabCut sees the box and this fraction of its larger side around it, at most so many pixels a
/// side.
constexpr double kGrabCutSurroundings = 0.5;
constexpr int kGrabCutMaxSide = 512;
constexpr int kGrabCutIterations = 5;
constexpr int kGrabCutMinBoxSide = 8;
constexpr double kGrabCutMinBoxShare = 0.05;
constexpr std::uint64_t kGrabCutSeed = 1;

/// A background is uniform if the border ring's robust deviation is small and most of it is near
/// the median.
constexpr double kRingShareOfSide = 0.01;
constexpr int kRingMinWidth = 2;
constexpr double kMaxRingDeviation = 6;
constexpr double kMinRingInliers = 0.7;
constexpr double kMinColourDifference = 12;
constexpr double kDeviationsOff = 4;
/// Enclosed background-coloured patches below this share of the object are its own white parts.
constexpr double kMaxHoleShare = 0.02;

std::string SizeText(const cv::Mat& image) {
  return std::to_string(image.cols) + " x " + std::to_string(image.rows);
}

ObjectMask OneBlob(const cv::Mat& mask, const std::string& source, const std::string& name) {
  const LargestBlob blob = FindLargestBlob(mask);
  const std::string subject = name + ", mask from " + source;
  if (blob.box.empty()) throw Error(subject, "marks no pixel as object (values over 125)", kRemedy);
  if (blob.fills_image) throw Error(subject, "marks every pixel as object", kRemedy);
  return {blob.mask > kObjectAbove, source, BlobWarnings(blob, mask.size())};
}

/// The alpha channel if the file has one, else the largest colour channel, so that a coloured label
/// counts.
cv::Mat MaskValues(const LoadedImage& file) {
  if (!file.alpha.empty()) return file.alpha;
  std::array<cv::Mat, 3> channels;
  cv::split(file.rgb, channels.data());
  return cv::max(channels[0], cv::max(channels[1], channels[2]));
}

ObjectMask FromFile(const LoadedImage& image, const std::filesystem::path& path) {
  const cv::Mat values = MaskValues(LoadImage(path));
  if (values.size() != image.rgb.size()) {
    throw BadFile(
        path.string(),
        "is a mask of " + SizeText(values) + " pixels for an image of " + SizeText(image.rgb),
        "give a mask of the image's size, after turning it upright");
  }
  double highest = 0;
  cv::minMaxLoc(values, nullptr, &highest);
  if (highest <= kObjectAbove) {
    throw BadFile(path.string(),
                  "marks no pixel as object, its highest value is " +
                      std::to_string(static_cast<int>(highest)),
                  "give the object values over 125");
  }
  return OneBlob(values, "file", path.string());
}

cv::Rect Enlarged(const cv::Rect& box, int by) {
  return {box.x - by, box.y - by, box.width + 2 * by, box.height + 2 * by};
}

cv::Rect CheckedBox(const cv::Rect& box, const cv::Size& size) {
  const auto is_sane = [](int value) {
    return std::abs(static_cast<std::int64_t>(value)) < 1 << 30;
  };
  if (!is_sane(box.x) || !is_sane(box.y) || !is_sane(box.width) || !is_sane(box.height)) {
    throw InvalidOption("box", "is far outside the image", "give x,y,w,h in pixels of the image");
  }
  const cv::Rect inside = box & cv::Rect({}, size);
  if (inside.width < kGrabCutMinBoxSide || inside.height < kGrabCutMinBoxSide) {
    throw InvalidOption("box", "has less than 8 pixels of the image on a side",
                        "give x,y,w,h in pixels of the image");
  }
  if (inside.size() == size) {
    throw InvalidOption("box", "covers the whole image and leaves no background",
                        "give a closer box or pass --reference-mask/--query-mask FILE");
  }
  return inside;
}

cv::Mat GrabCut(const cv::Mat& rgb, const cv::Rect& box) {
  // GrabCut's clustering draws from the thread's generator; equal pictures must get equal masks.
  const std::uint64_t previous_state = cv::theRNG().state;
  cv::theRNG().state = kGrabCutSeed;
  cv::Mat labels, background_model, foreground_model;
  cv::grabCut(rgb, labels, box, background_model, foreground_model, kGrabCutIterations,
              cv::GC_INIT_WITH_RECT);
  cv::theRNG().state = previous_state;
  return (labels & 1) * 255;
}

ObjectMask FromBox(const LoadedImage& image, const cv::Rect& requested, const std::string& name) {
  const cv::Rect box = CheckedBox(requested, image.rgb.size());
  const int around = static_cast<int>(kGrabCutSurroundings * std::max(box.width, box.height)) + 1;
  const cv::Rect region = Enlarged(box, around) & cv::Rect({}, image.rgb.size());
  const double scale =
      std::min(1.0, static_cast<double>(kGrabCutMaxSide) / std::max(region.width, region.height));
  cv::Mat reduced;
  cv::resize(image.rgb(region), reduced, {}, scale, scale, cv::INTER_AREA);
  const cv::Point2d offset = (box.tl() - region.tl()) * 1.0;
  const cv::Rect reduced_box(
      cv::Point(cvRound(offset.x * scale), cvRound(offset.y * scale)),
      cv::Size(std::max(1, cvRound(box.width * scale)), std::max(1, cvRound(box.height * scale))));
  const cv::Mat found = GrabCut(reduced, reduced_box & cv::Rect({}, reduced.size()));
  if (cv::countNonZero(found) < kGrabCutMinBoxShare * reduced_box.area()) {
    throw Error(name, "shows nothing in the box that differs from its surroundings",
                "pass --reference-mask/--query-mask FILE");
  }
  cv::Mat mask = cv::Mat::zeros(image.rgb.size(), CV_8UC1);
  cv::resize(found, mask(region), region.size(), 0, 0, cv::INTER_LINEAR);
  return OneBlob(mask, "box", name);
}

/// The pixels of the border ring, one row.
cv::Mat BorderRing(const cv::Mat& rgb) {
  const int width =
      std::max(kRingMinWidth, cvRound(kRingShareOfSide * std::min(rgb.rows, rgb.cols)));
  const std::array<cv::Mat, 4> sides = {
      rgb.rowRange(0, width), rgb.rowRange(rgb.rows - width, rgb.rows),
      rgb(cv::Range(width, rgb.rows - width), cv::Range(0, width)),
      rgb(cv::Range(width, rgb.rows - width), cv::Range(rgb.cols - width, rgb.cols))};
  cv::Mat ring(1, 0, CV_8UC3);
  std::vector<cv::Mat> rows;
  for (const cv::Mat& side : sides) rows.push_back(side.clone().reshape(3, 1));
  cv::hconcat(rows, ring);
  return ring;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

struct UniformColour {
  cv::Vec3d colour;
  double tolerance = 0;  ///< largest channel difference that still is background
};

/// Largest channel difference between two colours.
double Difference(const cv::Vec3b& pixel, const cv::Vec3d& colour) {
  return cv::norm(cv::Vec3d(pixel) - colour, cv::NORM_INF);
}

std::optional<UniformColour> FindUniformColour(const cv::Mat& ring) {
  UniformColour background;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> values;
    for (int i = 0; i < ring.cols; ++i) values.push_back(ring.at<cv::Vec3b>(i)[c]);
    background.colour[c] = Median(std::move(values));
  }
  std::vector<double> differences;
  for (int i = 0; i < ring.cols; ++i) {
    differences.push_back(Difference(ring.at<cv::Vec3b>(i), background.colour));
  }
  const double deviation = 1.4826 * Median(differences);
  background.tolerance = std::max(kMinColourDifference, kDeviationsOff * deviation);
  const auto inliers = std::ranges::count_if(
      differences, [&](double difference) { return difference <= background.tolerance; });
  const bool is_uniform =
      deviation <= kMaxRingDeviation && static_cast<double>(inliers) >= kMinRingInliers * ring.cols;
  return is_uniform ? std::optional(background) : std::nullopt;
}

/// 255 where the smoothed picture differs from the background.
cv::Mat Different(const cv::Mat& rgb, const UniformColour& background) {
  cv::Mat smooth, similar;
  cv::medianBlur(rgb, smooth, 3);
  const cv::Scalar colour(background.colour[0], background.colour[1], background.colour[2]);
  const cv::Scalar tolerance = cv::Scalar::all(background.tolerance);
  cv::inRange(smooth, colour - tolerance, colour + tolerance, similar);
  return ~similar;
}

/// Fills enclosed background-coloured patches unless they are large enough to be real holes.
void FillSmallHoles(cv::Mat& object) {
  cv::Mat labels, stats, centroids;
  const int count = cv::connectedComponentsWithStats(~object, labels, stats, centroids, 4, CV_32S);
  const double largest_hole = kMaxHoleShare * cv::countNonZero(object);
  std::vector<bool> is_small_hole(count, false);
  for (int label = 1; label < count; ++label) {
    const int* const patch = stats.ptr<int>(label);
    const cv::Rect box(patch[cv::CC_STAT_LEFT], patch[cv::CC_STAT_TOP], patch[cv::CC_STAT_WIDTH],
                       patch[cv::CC_STAT_HEIGHT]);
    is_small_hole[label] =
        patch[cv::CC_STAT_AREA] <= largest_hole && !TouchesBorder(box, object.size());
  }
  for (int y = 0; y < object.rows; ++y) {
    const int* const label = labels.ptr<int>(y);
    for (int x = 0; x < object.cols; ++x) {
      if (is_small_hole[label[x]]) object.at<uchar>(y, x) = 255;
    }
  }
}

ObjectMask FromBackground(const LoadedImage& image, const std::string& name) {
  const std::optional<UniformColour> background = FindUniformColour(BorderRing(image.rgb));
  if (!background) {
    throw Error(
        name, "has neither a mask nor an alpha channel, and its background is not one plain colour",
        kRemedy);
  }
  cv::Mat object = Different(image.rgb, *background);
  FillSmallHoles(object);
  return OneBlob(object, "background", name);
}

}  // namespace

ObjectMask FindObjectMask(const LoadedImage& image, const MaskRequest& request,
                          const std::string& image_name) {
  if (request.file) return FromFile(image, *request.file);
  if (request.box) return FromBox(image, *request.box, image_name);
  if (!image.alpha.empty()) return OneBlob(image.alpha, "alpha", image_name);
  return FromBackground(image, image_name);
}

cv::Rect2d MaskBox(const cv::Mat& mask) {
  const cv::Rect box = cv::boundingRect(mask > kObjectAbove);
  if (box.empty()) throw Error("mask", "is empty", "mark the object with values over 125");
  return cv::Rect2d(box);
}

}  // namespace antipode
