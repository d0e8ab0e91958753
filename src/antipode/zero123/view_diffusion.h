#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <torch/torch.h>

#include "antipode/geometry/viewpoints.h"
#include "antipode/util/progress.h"
#include "antipode/zero123/zero123.h"

namespace antipode {

/// What the network predicts at x = a x_0 + s noise, a = sqrt(alpha_bar), s = sqrt(1 - alpha_bar).
enum class DiffusionTarget {
  kNoise,
  kVelocity,  ///< a noise - s x_0 (Salimans and Ho, ICLR 2022)
};

/// How a view is asked for.
enum class PoseCondition {
  kRelativeRotation,  ///< the nine entries of R in x_view = R x_picture, camera axes: no elevation is needed
  kZero123,           ///< polar change, sine and cosine of the azimuth change, distance change
};

/// The shape of a small diffusion model in pixel space: the same UNet as Zero123's.
struct ViewDiffusionConfig {
  int image_size = 64;
  UnetConfig unet = {};
  DiffusionTarget target = DiffusionTarget::kVelocity;
  PoseCondition pose = PoseCondition::kRelativeRotation;
  int patch = 8;  ///< side of the picture's patches that become context tokens, pixels

  /// 64 pixels, multipliers 1, 2, 3, attention at 16 pixels with 16 channels a head.
  static ViewDiffusionConfig Small(std::int64_t base_width = 96);
  void Check() const;

  std::map<std::string, std::string> ToMetadata() const;
  /// Whether a model with this metadata is such a one.
  static bool IsIn(const std::map<std::string, std::string>& metadata);
  static ViewDiffusionConfig FromMetadata(const std::map<std::string, std::string>& metadata, const std::string& file);
};

/// One view relative to the picture, in both forms.
struct ViewCondition {
  Eigen::Matrix3d view_from_picture = Eigen::Matrix3d::Identity();
  RelativeView relative;
};

/// Imagines object-centric views of the object in an object-centric picture, without a latent space. The noisy view and
/// the picture go into the UNet side by side; its context tokens are the pose and the picture's patches.
class ViewDiffusionImpl : public torch::nn::Module {
 public:
  explicit ViewDiffusionImpl(const ViewDiffusionConfig& config);

  /// @return [P, numbers of the pose condition]
  torch::Tensor PoseNumbers(std::span<const ViewCondition> views) const;

  /// What the network says of noisy views, in its own target.
  /// @param noisy, pictures [P, 3, S, S], -1..1
  /// @param timesteps [P]
  /// @param poses of PoseNumbers
  /// @param is_conditional [P], 0 or 1; 0 hides picture and pose (classifier-free guidance)
  torch::Tensor forward(const torch::Tensor& noisy, const torch::Tensor& pictures, const torch::Tensor& timesteps,
                        const torch::Tensor& poses, const torch::Tensor& is_conditional);

  /// @param picture [1, 3, S, S], -1..1
  /// @param names of the views, for their noise
  /// @return [P, 3, S, S], 0..1
  torch::Tensor SampleViews(const torch::Tensor& picture, std::span<const ViewCondition> views, std::span<const std::string> names,
                            const Zero123Options& options, const ProgressCallback& progress = {});

  const ViewDiffusionConfig& config() const { return config_; }
  const NoiseSchedule& schedule() const { return schedule_; }

 private:
  struct Input {
    torch::Tensor x;  ///< noisy view and picture, side by side
    UnetContext context;
  };
  Input Assemble(const torch::Tensor& noisy, const torch::Tensor& pictures, const torch::Tensor& poses, const torch::Tensor& is_conditional);

  ViewDiffusionConfig config_;
  NoiseSchedule schedule_;
  Unet unet_{nullptr};
  Dense pose_{nullptr};
  torch::nn::Conv2d patches_{nullptr};
};
TORCH_MODULE(ViewDiffusion);

/// The noise in x that a prediction of `target` stands for.
torch::Tensor NoiseFromTarget(DiffusionTarget target, const torch::Tensor& prediction, const torch::Tensor& x, double alpha_bar);

/// What the network should have predicted.
/// @param alpha_bar [P, 1, 1, 1]
torch::Tensor TargetOf(DiffusionTarget target, const torch::Tensor& clean, const torch::Tensor& noise, const torch::Tensor& alpha_bar);

}  // namespace antipode
