#include "antipode/synthesis/zero123_synthesizer.h"

#include <algorithm>
#include <new>

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "antipode/object/object_view.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/weights/registry.h"
#include "antipode/zero123/picture.h"

namespace antipode {
namespace {

constexpr int kLeastCrop = 32, kGreatestCrop = 2048;

/// The object-centric crop at the photograph's own resolution, prepared as the model was trained.
cv::Mat ReferencePicture(const cv::Mat& image, const cv::Mat& mask, const PinholeCamera& camera) {
  const cv::Rect box = cv::boundingRect(mask > 125);
  ObjectViewOptions options;
  options.size = std::clamp(static_cast<int>((1 + 2 * options.margin) * std::max(box.width, box.height)), kLeastCrop, kGreatestCrop);
  return PrepareReferencePicture(MakeObjectView(image, mask, camera, options).image);
}

std::string FingerprintOf(const cv::Mat& picture, const std::string& model_sha256, const Zero123Options& options) {
  const nlohmann::json settings = {{"picture", Sha256Hex({reinterpret_cast<const std::byte*>(picture.data), picture.total() * picture.elemSize()})},
                                   {"model", model_sha256}, {"solver", NameOf(options.solver)}, {"steps", options.steps},
                                   {"eta", options.eta}, {"guidance_scale", options.guidance_scale},
                                   {"guidance", {options.guidance_begin, options.guidance_end}},
                                   {"full_step_every", options.full_step_every}, {"seed", options.seed}};
  const std::string text = settings.dump();
  return Sha256Hex(std::as_bytes(std::span(text)));
}

}  // namespace

void Zero123SynthesisOptions::Check() const {
  sampling.Check();
  if (batch < 1 || batch > 256) throw InvalidOption("batch", "is " + std::to_string(batch), "use 1 to 256");
}

Zero123Synthesizer::Zero123Synthesizer(const std::string& model, const cv::Mat& image, const cv::Mat& mask,
                                       const PinholeCamera& camera, const Zero123SynthesisOptions& options,
                                       torch::Device device)
    : model_(Zero123::Load(model, device)), options_(options), picture_(ReferencePicture(image, mask, camera)),
      fingerprint_(FingerprintOf(picture_, FindModel(model).sha256, options.sampling)) {
  options.Check();
  const torch::InferenceMode inference;
  conditioning_ = model_.Condition(PictureTensor(picture_).to(device));
}

std::vector<cv::Mat> Zero123Synthesizer::Imagine(std::span<const ViewRequest> requests, const ProgressCallback& progress) const {
  const torch::InferenceMode inference;
  std::vector<RelativeView> viewpoints;
  std::vector<std::string> names;
  for (const ViewRequest& request : requests) {
    viewpoints.push_back(request.relative);
    names.push_back(request.name);
  }
  const auto latents = model_.SampleLatents(conditioning_, viewpoints, names, options_.sampling, progress);
  std::vector<cv::Mat> pictures;
  for (std::int64_t i = 0; i < latents.size(0); ++i)
    pictures.push_back(PicturesOf(model_.Decode(latents.slice(0, i, i + 1))).front());
  return pictures;
}

void Zero123Synthesizer::Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                                    const ProgressCallback& progress) const {
  const auto evaluations = static_cast<std::int64_t>(TimesOf(options_.sampling, model_.schedule).times.size());
  const auto batch = static_cast<std::size_t>(options_.batch);
  const auto batches = static_cast<std::int64_t>((requests.size() + batch - 1) / batch);
  for (std::size_t first = 0; first < requests.size(); first += batch) {
    const auto some = requests.subspan(first, std::min(batch, requests.size() - first));
    const auto done = static_cast<std::int64_t>(first / batch) * evaluations;
    const auto report = [&](const Progress& inner) {
      if (progress) progress({"imagining views", done + inner.done, batches * evaluations, std::to_string(first) + " of " + std::to_string(requests.size()) + " views"});
    };
    try {
      const std::vector<cv::Mat> pictures = Imagine(some, report);
      for (std::size_t i = 0; i < some.size(); ++i) use(PosedView(some[i], pictures[i]));
    } catch (const c10::OutOfMemoryError&) {
      throw Error("denoising", "ran out of memory", "use a smaller --batch");
    } catch (const std::bad_alloc&) {
      throw Error("denoising", "ran out of memory", "use a smaller --batch");
    }
  }
}

}  // namespace antipode
