#pragma once

#include <map>
#include <span>
#include <string>

#include <torch/torch.h>

#include "antipode/geometry/rigid3.h"
#include "antipode/nn/efficientnet_lite.h"
#include "antipode/prior/object_encoder.h"

namespace antipode {

struct ViewVolumeConfig {
  int image_size = 128;  ///< side of the square picture, pixels; a multiple of 32
  int width = 192;       ///< of the transformer
  int layers = 3;
  int heads = 6;
  int feed_forward = 576;
  int fine = 128;        ///< channels at stride 8
  int finest = 96;       ///< channels at stride 4, the resolution of the volume
  int depth = 32;        ///< layers of the volume behind each other
  void Check() const;

  std::map<std::string, std::string> ToMetadata() const;
  /// Whether a model with this metadata is such a one.
  static bool IsIn(const std::map<std::string, std::string>& metadata);
  /// @throws BadFile naming `file` and the missing or malformed entry
  static ViewVolumeConfig FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file);
};

/// What an object-centric picture tells of the whole object: a coarse volume of colour and density in the axes of the picture's
/// camera. Its unit is half of the larger side of the object in the picture; its middle is on the optical axis, where the object's is.
/// Volume coordinate 1 lies at kVolumeExtent. Colours are before a sigmoid, densities before a softplus.
///
/// The backbone is that of the object prior and stays as it is; its features of strides 16 and 32 become tokens, a transformer
/// lets all sides know of each other, and two upsampling stages, the first one joined by the features of stride 8, end in columns of the volume.
class ViewVolumeImpl : public torch::nn::Module {
 public:
  explicit ViewVolumeImpl(const ViewVolumeConfig& config);

  /// @param images [N, 3, S, S], RGB in 0..1, object-centric on white
  /// @return [N, 4, D, S / 4, S / 4]: red, green, blue, density; z, y, x
  torch::Tensor forward(const torch::Tensor& images);

  const ViewVolumeConfig& config() const { return config_; }
  EfficientNetLite0 backbone{nullptr};

 private:
  ViewVolumeConfig config_;
  torch::nn::LayerNorm norm8{nullptr}, norm16{nullptr}, norm32{nullptr}, norm_out{nullptr};
  torch::nn::Linear project8{nullptr}, project16{nullptr}, project32{nullptr}, expand8{nullptr};
  torch::nn::ModuleList layers;
  torch::nn::GroupNorm norm_fine{nullptr}, norm_finest{nullptr};
  torch::nn::Conv2d fine1{nullptr}, fine2{nullptr}, expand4{nullptr}, finest1{nullptr}, finest2{nullptr}, to_columns{nullptr};
  torch::Tensor position;
};
TORCH_MODULE(ViewVolume);

/// Half sides of the volume, in its unit: the object fills the picture, and may be deeper than it is wide.
inline constexpr double kVolumeExtent[3] = {1.1, 1.1, 1.6};  // x, y, z

/// A camera with the principal point in the middle of a square picture.
struct VolumeCamera {
  Rigid3 camera_from_volume;
  double focal_length = 0;  ///< in halves of the picture's side
};

struct VolumeViews {
  torch::Tensor rgb;    ///< [N, 3, S, S], 0..1, on white
  torch::Tensor alpha;  ///< [N, 1, S, S]
};

struct VolumeRendering {
  int image_size = 64;
  int samples = 48;  ///< along every ray
  /// Training moves the samples by a random part of their distance, so that all of the volume is seen.
  bool jitter = false;
};

/// Volume rendering (Max, 1995; Mildenhall et al., ECCV 2020): with samples k at distance delta along the ray,
///   alpha_k = 1 - exp(-softplus(density_k) delta), rgb = sum_k alpha_k prod_{j<k} (1 - alpha_j) sigmoid(colour_k) + what is left of white.
/// @param volumes [B, 4, D, H, W] of ViewVolume
/// @param cameras the same number for each volume, volume by volume
VolumeViews RenderVolumes(const torch::Tensor& volumes, std::span<const VolumeCamera> cameras, const VolumeRendering& rendering = {});

}  // namespace antipode
