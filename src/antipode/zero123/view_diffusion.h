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
  int cell = 1;   ///< side of the squares of pixels whose channels the UNet sees side by side, as one pixel
  int patch = 8;  ///< side of the picture's patches that become context tokens, pixels
  /// Of maps that show what is known of each view beforehand, such as CodeMaps of the object prior; 0: there are none.
  int guide_channels = 0;
  int GuideSize() const { return image_size / 4; }  ///< side of these maps

  /// 64 pixels in cells. Of cells of 2: levels of 32, 16 and 8 cells a side, multipliers 2, 3, 3; of 4: of 16 and 8, multipliers
  /// 2, 3, several times as fast, in less detail. One residual block a level, attention at the second one.
  static ViewDiffusionConfig Small(std::int64_t base_width = 32, int cell = 2);
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
/// the picture go into the UNet side by side, and the guide beside them; its context tokens are the pose and the picture's
/// patches.
class ViewDiffusionImpl : public torch::nn::Module {
 public:
  explicit ViewDiffusionImpl(const ViewDiffusionConfig& config);

  /// @return [P, numbers of the pose condition]
  torch::Tensor PoseNumbers(std::span<const ViewCondition> views) const;

  /// What the network says of noisy views, in its own target.
  /// @param noisy, pictures [P, 3, S, S], -1..1
  /// @param timesteps [P]
  /// @param poses of PoseNumbers
  /// @param is_conditional [P], 0 or 1; 0 hides picture, pose and guide (classifier-free guidance)
  /// @param guides [P, guide_channels, GuideSize(), GuideSize()], if there are any
  torch::Tensor forward(const torch::Tensor& noisy, const torch::Tensor& pictures, const torch::Tensor& timesteps,
                        const torch::Tensor& poses, const torch::Tensor& is_conditional, const torch::Tensor& guides = {});

  /// @param picture [1, 3, S, S], -1..1
  /// @param names of the views, for their noise
  /// @return [P, 3, S, S], 0..1
  torch::Tensor SampleViews(const torch::Tensor& picture, std::span<const ViewCondition> views, std::span<const std::string> names,
                            const Zero123Options& options, const torch::Tensor& guides = {}, const ProgressCallback& progress = {});

  const ViewDiffusionConfig& config() const { return config_; }
  const NoiseSchedule& schedule() const { return schedule_; }

 private:
  struct Input {
    torch::Tensor x;  ///< noisy view, picture and guide, side by side; cells, not pixels
    UnetContext context;
  };
  Input Assemble(const torch::Tensor& noisy, const torch::Tensor& pictures, const torch::Tensor& poses, const torch::Tensor& is_conditional,
                 const torch::Tensor& guides);

  ViewDiffusionConfig config_;
  NoiseSchedule schedule_;
  Unet unet_{nullptr};
  Dense pose_{nullptr};
  torch::nn::Conv2d patches_{nullptr}, guide_{nullptr};
};
TORCH_MODULE(ViewDiffusion);

/// The noise in x that a prediction of `target` stands for.
torch::Tensor NoiseFromTarget(DiffusionTarget target, const torch::Tensor& prediction, const torch::Tensor& x, double alpha_bar);

/// What the network should have predicted.
/// @param alpha_bar [P, 1, 1, 1]
torch::Tensor TargetOf(DiffusionTarget target, const torch::Tensor& clean, const torch::Tensor& noise, const torch::Tensor& alpha_bar);

}  // namespace antipode
