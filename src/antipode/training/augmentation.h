#pragma once

#include <random>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <torch/torch.h>

#include "antipode/training/view_cache.h"

namespace antipode {

/// How the cameras of one group of views are rolled.
enum class RollRegime { kLevel, kTilted, kAny };

struct AugmentationOptions {
  double level_share = 0.45;    ///< groups rolled by a normal angle of `level_deviation_deg`
  double tilted_share = 0.40;   ///< groups rolled uniformly up to `tilted_deg`; the rest by any angle
  double level_deviation_deg = 4;
  double tilted_deg = 50;
  double mirror_share = 0.5;
  double crop_shift = 0.03;     ///< of the box's side
  double crop_scale = 0.05;
  double mask_error_share = 0.2;
  int mask_error_pixels = 5;
  double blur_share = 0.2;      ///< out of focus or by motion, equally often
  double compression_share = 0.2;  ///< kept as a JPEG of low quality
  double cut_share = 0.2;       ///< up to a quarter cut off by the picture's border
  double recolor_share = 0.5;   ///< groups with turned hues
};

/// One augmented object-centric image.
struct AugmentedView {
  cv::Mat rgba;               ///< S x S, 8UC4
  Rigid3 camera_from_object;  ///< as in ViewCache; of the mirrored object where mirrored
  double focal_length = 0;    ///< pixels; the principal point is the middle
};

/// A cached view seen by a camera rolled by `roll_deg`, cropped around its mask as at test time, with
/// jitter; R' = R_look Rz(roll) R, t' likewise. Mirroring flips x of image and object: R' = M R M, t' = M t, M = diag(-1, 1, 1).
AugmentedView AugmentView(const ViewCache& cache, int group, int view, double roll_deg, bool mirrored,
                          int image_size, const AugmentationOptions& options, std::mt19937_64& random);

/// A cached view as it is, cropped around its mask.
AugmentedView PlainView(const ViewCache& cache, int group, int view, int image_size);

/// The picture on white, [1, 3, S, S], 0..1.
torch::Tensor OnWhite(const AugmentedView& view);

RollRegime DrawRegime(const AugmentationOptions& options, std::mt19937_64& random);
double DrawRoll(RollRegime regime, const AugmentationOptions& options, std::mt19937_64& random);

/// Photometric changes on the background-free object: hue and saturation (the same for a whole group),
/// brightness, white balance, gamma and noise (view by view). Counter-based: depends on `seed` only.
/// @param rgba [groups * views, 4, S, S], 0..1
/// @return [groups * views, 3, S, S] on white
torch::Tensor AugmentColors(const torch::Tensor& rgba, int groups, const AugmentationOptions& options,
                            std::uint64_t seed);

}  // namespace antipode
