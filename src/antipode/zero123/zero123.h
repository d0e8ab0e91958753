#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <torch/torch.h>

#include "antipode/util/progress.h"
#include "antipode/weights/safetensors.h"
#include "antipode/zero123/autoencoder.h"
#include "antipode/zero123/clip_image_tower.h"
#include "antipode/zero123/noise_schedule.h"
#include "antipode/zero123/pose_projection.h"
#include "antipode/zero123/samplers.h"
#include "antipode/zero123/unet.h"

namespace antipode {

struct Zero123Config {
  UnetConfig unet = {};
  AutoencoderConfig autoencoder = {};
  ClipConfig clip = {};

  /// One entry, "zero123_config", JSON.
  std::map<std::string, std::string> ToMetadata() const;
  /// The published configuration if there is no such entry. @throws BadFile if it is malformed
  static Zero123Config FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file);
};

struct Zero123Options {
  Solver solver = Solver::kDdim;
  int steps = 50;              ///< of DDIM, as the paper's program counts: 50 are 49 evaluations
  double eta = 1;              ///< of DDIM
  double guidance_scale = 3;
  /// Guidance is applied between these shares of the steps, outside the conditional prediction is taken as it is.
  double guidance_begin = 0, guidance_end = 1;
  /// The deep levels are computed at every n-th step only (see UnetCache); 1: always.
  int full_step_every = 1;
  ContextPath context_path = ContextPath::kConstantForOneToken;
  std::uint64_t seed = 1;
  void Check() const;

  /// About a fifteenth of the work of the paper's program.
  static Zero123Options Fast();
};

/// Everything of a picture that does not depend on the viewpoint.
struct PictureConditioning {
  torch::Tensor embedding;  ///< [1, 1, context_width], of CLIP
  torch::Tensor latent;     ///< [1, 4, H / 8, W / 8], of the autoencoder, not scaled
};

/// What the denoiser of one batch needs, prepared once for all steps.
struct ViewConditioning {
  torch::Tensor latent;   ///< [P, 4, h, w]
  UnetContext guided;     ///< of the unconditional (zeros) and the conditional half, [2 P, 1, context_width]
  UnetContext alone;      ///< of the conditional half
};

/// How the denoiser computes; everything else is float32.
enum class DenoiserPrecision {
  kFloat32,
  kBFloat16,  ///< half the memory; several times as fast on processors that multiply it in hardware
};

/// Zero-1-to-3 (Liu et al., ICCV 2023): imagines an object in a picture from other viewpoints.
class Zero123 {
 public:
  /// With uninitialised weights.
  explicit Zero123(const Zero123Config& config = {});

  /// From an imported model. @throws BadFile listing what is missing
  static Zero123 Load(const std::string& model_or_folder = "zero123", torch::Device device = torch::kCPU,
                      DenoiserPrecision precision = DenoiserPrecision::kFloat32);

  /// @param picture [1, 3, H, W], RGB in -1..1, object on white
  PictureConditioning Condition(const torch::Tensor& picture) const;
  ViewConditioning Prepare(const PictureConditioning& picture, std::span<const RelativeView> viewpoints,
                           ContextPath path = ContextPath::kConstantForOneToken) const;

  /// @param names of the views, for their noise; one a viewpoint
  /// @return latents [P, 4, h, w], scaled
  torch::Tensor SampleLatents(const PictureConditioning& picture, std::span<const RelativeView> viewpoints,
                              std::span<const std::string> names, const Zero123Options& options = {},
                              const ProgressCallback& progress = {}) const;
  /// @return [P, 3, H, W] in 0..1
  torch::Tensor Decode(const torch::Tensor& latents) const;

  /// The guided noise prediction of a batch, as the sampler asks for it.
  NoisePredictor Predictor(const ViewConditioning& views, const Zero123Options& options, int evaluations,
                           const Observation& observation = {}) const;

  Unet unet;
  Autoencoder autoencoder;
  ClipImageTower clip;
  PoseProjection projection;
  NoiseSchedule schedule;
};

/// The weights of a model with the denoiser's convolutions stored pixel by pixel ("channels last"), which the metadata
/// say: so they can be used where they are mapped. `Zero123::Load` reads both layouts.
LazyTensorFile StoredForUse(LazyTensorFile file);

/// The times that the options ask the denoiser at, and where the last step ends.
SamplerInput TimesOf(const Zero123Options& options, const NoiseSchedule& schedule);

}  // namespace antipode
