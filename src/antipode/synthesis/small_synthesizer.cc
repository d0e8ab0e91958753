#include "antipode/synthesis/small_synthesizer.h"

#include <algorithm>

#include "antipode/nn/module_weights.h"
#include "antipode/synthesis/object_centric_picture.h"
#include "antipode/synthesis/volume_synthesizer.h"
#include "antipode/weights/registry.h"
#include "antipode/zero123/picture.h"

namespace antipode {
namespace {

ViewDiffusion ViewDiffusionFrom(const TensorFile& file, const std::string& model) {
  ViewDiffusion network(ViewDiffusionConfig::FromMetadata(file.metadata, model));
  LoadInto(*network, file, model);
  return network;
}

}  // namespace

bool IsViewDiffusion(const std::string& model) {
  // Whoever loads it verifies it: hashing gigabytes of another model here would only take time.
  return ViewDiffusionConfig::IsIn(SafetensorsReader(FindModel(model).file).metadata());
}

SmallSynthesizer::SmallSynthesizer(const std::string& model, const cv::Mat& object_on_white, const Zero123SynthesisOptions& options,
                                   torch::Device device)
    : SmallSynthesizer(LoadModel(model), model, object_on_white, options, device) {}

SmallSynthesizer::SmallSynthesizer(const TensorFile& file, const std::string& model, const cv::Mat& object_on_white,
                                   const Zero123SynthesisOptions& options, torch::Device device)
    : model_(ViewDiffusionFrom(file, model)), guide_(ViewGuide::Of(file.metadata, model, device)), options_(options) {
  options.Check();
  model_->to(device);
  const cv::Mat picture = ObjectCentricPicture(object_on_white, model_->config().image_size);
  picture_ = PictureTensor(picture).to(device);
  if (guide_) code_ = guide_->Encode((PictureTensor(ObjectCentricPicture(object_on_white, guide_->PictureSize())) + 1) / 2);
  fingerprint_ = FingerprintOfSynthesis(picture, FindModel(model).sha256, options);
}

SynthesisCamera SmallSynthesizer::Camera() const { return {kTrainingFocalLength, 2 * kTrainingFocalLength * (1 + 2 * kObjectCentricMargin)}; }

void SmallSynthesizer::Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                                  const ProgressCallback& progress) const {
  const auto batch = static_cast<std::size_t>(options_.batch);
  for (std::size_t first = 0; first < requests.size(); first += batch) {
    const auto some = requests.subspan(first, std::min(batch, requests.size() - first));
    if (progress) progress({"imagining views", static_cast<std::int64_t>(first), static_cast<std::int64_t>(requests.size()), {}});
    std::vector<ViewCondition> conditions;
    std::vector<std::string> names;
    for (const ViewRequest& request : some) {
      conditions.push_back({ViewFromPicture(request), request.relative});
      names.push_back(request.name);
    }
    const torch::Tensor guides =
        guide_ ? guide_->Maps(code_, conditions, model_->config().GuideSize()).to(picture_.device()) : torch::Tensor();
    const auto pictures = PicturesOf(model_->SampleViews(picture_, conditions, names, options_.sampling, guides));
    for (std::size_t i = 0; i < some.size(); ++i) use(PosedView(some[i], pictures[i], Camera()));
  }
}

std::unique_ptr<ViewSynthesizer> MakeDiffusionSynthesizer(const std::string& model, const cv::Mat& object_on_white,
                                                          const Zero123SynthesisOptions& options, torch::Device device) {
  if (IsViewVolume(model)) return std::make_unique<VolumeSynthesizer>(model, object_on_white, device);
  if (IsViewDiffusion(model)) return std::make_unique<SmallSynthesizer>(model, object_on_white, options, device);
  return std::make_unique<Zero123Synthesizer>(model, object_on_white, options, device);
}

}  // namespace antipode
