#include "antipode/synthesis/zero123_synthesizer.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "antipode/image/load.h"
#include "antipode/nn/out_of_memory.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/formatted.h"
#include "antipode/weights/registry.h"
#include "antipode/zero123/picture.h"

namespace antipode {
namespace {

SynthesisCamera CameraOf(const cv::Mat& picture) {
  const cv::Size extent = BoxOfObject(picture).size();
  return {kTrainingFocalLength, 2 * kTrainingFocalLength * picture.cols / std::max(extent.width, extent.height)};
}

template <typename Action>
auto SayingMemoryRanOut(const char* stage, const char* remedy, const Action& action) {
  try {
    return action();
  } catch (const std::exception& error) {
    if (IsOutOfMemory(error)) throw Error(stage, "ran out of memory", remedy);
    throw;
  }
}

}  // namespace

std::string FingerprintOfSynthesis(const cv::Mat& picture, const std::string& model_sha256, const Zero123SynthesisOptions& synthesis) {
  const Zero123Options& options = synthesis.sampling;
  const nlohmann::json settings = {{"picture", Sha256OfPicture(picture)},
                                   {"model", model_sha256}, {"solver", NameOf(options.solver)}, {"steps", options.steps},
                                   {"eta", options.eta}, {"guidance_scale", options.guidance_scale},
                                   {"guidance", {options.guidance_begin, options.guidance_end}},
                                   {"full_step_every", options.full_step_every}, {"seed", options.seed},
                                   {"bfloat16", synthesis.precision == DenoiserPrecision::kBFloat16}};
  const std::string text = settings.dump();
  return Sha256Hex(std::as_bytes(std::span(text)));
}

void Zero123SynthesisOptions::Check() const {
  sampling.Check();
  if (batch < 1 || batch > 256) throw InvalidOption("batch", "is " + std::to_string(batch), "use 1 to 256");
  if (!(memory_limit_gb >= 0)) throw InvalidOption("memory_limit", "is not a positive number of gigabytes");
}

double MemoryForViews(const Zero123& model, int views) {
  constexpr double kBeside = 0.7e9;  // program, libraries, one picture's decoding
  constexpr double kMaps = 60;       // feature maps of the first level that both halves of one view keep at a time
  constexpr double kLatentPixels = 32 * 32;
  double weights = 0;
  for (const torch::nn::Module* const module : std::initializer_list<const torch::nn::Module*>{
           &*model.unet, &*model.autoencoder, &*model.clip, &*model.projection})
    for (const torch::Tensor& parameter : module->parameters()) weights += static_cast<double>(parameter.nbytes());
  return weights + kBeside + views * kMaps * sizeof(float) * kLatentPixels * static_cast<double>(model.unet->config().base_width);
}

struct Zero123Synthesizer::Loaded {
  Zero123 model;
  PictureConditioning conditioning;
};

Zero123Synthesizer::Zero123Synthesizer(const std::string& model, const cv::Mat& object_on_white,
                                       const Zero123SynthesisOptions& options, torch::Device device)
    : model_name_(model), options_(options), device_(device), picture_(PrepareReferencePicture(object_on_white)),
      camera_(CameraOf(picture_)), fingerprint_(FingerprintOfSynthesis(picture_, FindModel(model).sha256, options)) {
  options.Check();
}

Zero123Synthesizer::~Zero123Synthesizer() = default;

const Zero123Synthesizer::Loaded& Zero123Synthesizer::Load() const {
  if (loaded_) return *loaded_;
  const torch::InferenceMode inference;
  loaded_ = SayingMemoryRanOut("loading the model", "use --precision bfloat16, or a machine with more memory", [&] {
    Zero123 model = Zero123::Load(model_name_, device_, options_.precision);
    PictureConditioning conditioning = model.Condition(PictureTensor(picture_).to(device_));
    return std::make_unique<Loaded>(Loaded{std::move(model), std::move(conditioning)});
  });
  return *loaded_;
}

std::size_t Zero123Synthesizer::BatchFor(const Zero123& model) const {
  if (options_.memory_limit_gb == 0) return static_cast<std::size_t>(options_.batch);
  const auto gigabytes = [&](int views) { return 1e-9 * MemoryForViews(model, views); };
  for (int views = options_.batch; views > 0; --views)
    if (gigabytes(views) <= options_.memory_limit_gb) return static_cast<std::size_t>(views);
  throw Error("memory limit", Formatted("of %.1f GB is below the %.1f GB that one view at a time needs", options_.memory_limit_gb, gigabytes(1)),
              "raise --memory-limit");
}

std::vector<cv::Mat> Zero123Synthesizer::Imagine(std::span<const ViewRequest> requests, const ProgressCallback& progress) const {
  const torch::InferenceMode inference;
  std::vector<RelativeView> viewpoints;
  std::vector<std::string> names;
  for (const ViewRequest& request : requests) {
    viewpoints.push_back(request.relative);
    names.push_back(request.name);
  }
  const auto& [model, conditioning] = Load();
  const auto latents = model.SampleLatents(conditioning, viewpoints, names, options_.sampling, progress);
  std::vector<cv::Mat> pictures;
  for (std::int64_t i = 0; i < latents.size(0); ++i)
    pictures.push_back(PicturesOf(model.Decode(latents.slice(0, i, i + 1))).front());
  return pictures;
}

void Zero123Synthesizer::Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                                    const ProgressCallback& progress) const {
  if (requests.empty()) return;
  if (progress) progress({"loading the model", 0, 0, {}});
  const Zero123& model = Load().model;
  const auto evaluations = static_cast<std::int64_t>(TimesOf(options_.sampling, model.schedule).times.size());
  const std::size_t batch = BatchFor(model);
  const auto batches = static_cast<std::int64_t>((requests.size() + batch - 1) / batch);
  for (std::size_t first = 0; first < requests.size(); first += batch) {
    const auto some = requests.subspan(first, std::min(batch, requests.size() - first));
    const auto done = static_cast<std::int64_t>(first / batch) * evaluations;
    const auto report = [&](const Progress& inner) {
      if (progress) progress({"imagining views", done + inner.done, batches * evaluations, std::to_string(first) + " of " + std::to_string(requests.size()) + " views"});
    };
    const std::vector<cv::Mat> pictures = SayingMemoryRanOut(
        "denoising", batch > 1 ? "use a smaller --batch, or --precision bfloat16" : "use --precision bfloat16, or a machine with more memory",
        [&] { return Imagine(some, report); });
    for (std::size_t i = 0; i < some.size(); ++i) use(PosedView(some[i], pictures[i], camera_));
  }
}

}  // namespace antipode
