#include "antipode/synthesis/volume_synthesizer.h"

#include "antipode/gen6d/shared_backbone.h"
#include "antipode/synthesis/object_centric_picture.h"
#include "antipode/synthesis/view_volume.h"
#include "antipode/synthesis/zero123_synthesizer.h"
#include "antipode/weights/registry.h"
#include "antipode/weights/safetensors.h"
#include "antipode/zero123/picture.h"

namespace antipode {
namespace {

constexpr int kSide = 96;             // of the views, pixels: the volume has no more detail
constexpr int kSamples = 32;
constexpr double kShownRadius = 1.5;  // so many object radii the views show on all sides of the middle
// Less opaque than the first is taken for nothing, more than the second for the object.
constexpr double kHaze = 0.25, kSolid = 0.65;

/// Where the network was not sure how deep the object is there is haze: whoever looks for the outline needs it gone.
torch::Tensor WithoutHaze(const VolumeViews& views) {
  const torch::Tensor solid = ((views.alpha - kHaze) / (kSolid - kHaze)).clamp(0, 1);
  const torch::Tensor color = (views.rgb - (1 - views.alpha)) / views.alpha.clamp_min(kHaze);
  return (color * solid + 1 - solid).clamp(0, 1);
}

}  // namespace

bool IsViewVolume(const std::string& model) { return ViewVolumeConfig::IsIn(SafetensorsReader(FindModel(model).file).metadata()); }

VolumeSynthesizer::VolumeSynthesizer(const std::string& model, const cv::Mat& object_on_white, torch::Device device) {
  const TensorFile file = LoadModel(model);
  ViewVolume network(ViewVolumeConfig::FromMetadata(file.metadata, model));
  LoadWithBackbone(*network, file, model);
  network->backbone->AbsorbNormalization();
  network->to(device);
  network->eval();
  const cv::Mat picture = ObjectCentricPicture(object_on_white, network->config().image_size);
  const torch::InferenceMode inference;
  volume_ = network->forward((PictureTensor(picture).to(device) + 1) / 2);
  fingerprint_ = FingerprintOfSynthesis(picture, FindModel(model).sha256, {});
}

SynthesisCamera VolumeSynthesizer::Camera() const { return {kTrainingFocalLength, 2 * kTrainingFocalLength * kShownRadius}; }

void VolumeSynthesizer::Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                                   const ProgressCallback& progress) const {
  const torch::InferenceMode inference;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    if (progress) progress({"rendering views", static_cast<std::int64_t>(i), static_cast<std::int64_t>(requests.size()), {}});
    const Rigid3 camera_from_volume{ViewFromPicture(requests[i]), Camera().distance * Eigen::Vector3d::UnitZ()};
    const VolumeCamera camera{camera_from_volume, 2 * Camera().focal_length};
    const torch::Tensor picture = WithoutHaze(RenderVolumes(volume_, std::span(&camera, 1), {.image_size = kSide, .samples = kSamples}));
    use(PosedView(requests[i], PicturesOf(picture.cpu()).front(), Camera()));
  }
}

}  // namespace antipode
