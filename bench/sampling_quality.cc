// sampling_quality MODEL MESHES [VIEWS]: how well a model that `antipode train views` wrote imagines, and what cheaper sampling
// costs. Renders views of the meshes, lets the model imagine each from another one, and prints for each way of sampling: peak
// signal-to-noise ratio against the rendering, the distance of both in the features of the prior's backbone (as LPIPS does with
// other networks: Zhang et al., CVPR 2018; 0 to 2), the ratio against 50 steps of DDIM, and how many times as fast it is. One thread.
// Of a model that `antipode train volume` wrote: the same of its views as the targets' own cameras see its volume.

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "antipode/gen6d/image_backbone.h"
#include "antipode/gen6d/shared_backbone.h"
#include "antipode/nn/module_weights.h"
#include "antipode/synthesis/view_guide.h"
#include "antipode/synthesis/view_volume.h"
#include "antipode/training/augmentation.h"
#include "antipode/training/views_trainer.h"
#include "antipode/training/volume_trainer.h"
#include "antipode/util/stopwatch.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/registry.h"
#include "antipode/zero123/view_diffusion.h"
#include "guarded_main.h"

namespace antipode {
namespace {

struct Example {
  torch::Tensor picture, view;  // [1, 3, S, S], 0..1
  ViewCondition condition;
  torch::Tensor guide;  // if the model wants one
};

/// Mean squared distance of two pictures' features, each of length 1, at strides 8 to 32.
class FeatureDistance {
 public:
  FeatureDistance() : backbone_(ImageBackbone::Make(BackboneKind::kEfficientNetLite0)) {
    torch::nn::Module holder;
    holder.register_module("backbone", backbone_);
    LoadBesideBackbone(holder, {}, LoadSharedBackbone("prior"), "prior");
  }

  double operator()(const torch::Tensor& a, const torch::Tensor& b) const {
    const torch::InferenceMode inference;
    const auto of_a = FeaturesOf(a), of_b = FeaturesOf(b);
    double distance = 0;
    for (std::size_t i = 0; i < of_a.size(); ++i) distance += (of_a[i] - of_b[i]).square().sum(1).mean().item<double>() / static_cast<double>(of_a.size());
    return distance;
  }

 private:
  std::vector<torch::Tensor> FeaturesOf(const torch::Tensor& picture) const {
    return backbone_->Features(at::upsample_bilinear2d(picture, {128, 128}, /*align_corners=*/false), {8, 16, 32});
  }

  std::shared_ptr<ImageBackbone> backbone_;
};

struct Way {
  std::string name;
  Zero123Options options;
};

std::vector<Way> Ways() {
  const Zero123Options fast = Zero123Options::Fast();
  Zero123Options guided = fast, full = fast;
  guided.guidance_end = 1;
  guided.full_step_every = full.full_step_every = 1;
  Zero123Options unguided = guided;
  unguided.guidance_scale = 1;
  return {{"DDIM, 50 steps", {}}, {"the same, another seed", {.seed = 2}}, {"DPM-Solver++, 8 steps", guided},
          {"  no guidance", unguided},
          {"  guidance on half of them", full}, {"  deep levels at every second (fast)", fast}};
}

ViewCache RenderCache(const TemporaryFolder& folder, const std::filesystem::path& meshes, int views) {
  ViewCacheOptions options;
  options.views_per_object = views;
  options.variants = 1;
  options.wide_share = 0;
  return ViewCache::OpenOrRender(folder.path() / "cache", MeshCollection::Open(meshes), options, {});
}

std::vector<Example> Render(const std::filesystem::path& meshes, const ViewDiffusionConfig& config, const std::optional<ViewGuide>& guide, int views) {
  const TemporaryFolder folder;
  const ViewCache cache = RenderCache(folder, meshes, views + 1);
  const auto plain = [&](int group, int view, int size) {
    const AugmentedView augmented = PlainView(cache, group, view, size);
    return std::pair{OnWhite(augmented), augmented.camera_from_object.rotation};
  };
  std::vector<Example> examples;
  for (int group = 0; group < cache.group_count(); ++group) {
    const auto [picture, from] = plain(group, 0, config.image_size);
    const torch::Tensor code = guide ? guide->Encode(plain(group, 0, guide->PictureSize()).first) : torch::Tensor();
    for (int view = 1; view <= views; ++view) {
      const auto [truth, to] = plain(group, view, config.image_size);
      Example example{picture, truth, {to * from.transpose(), {}}, {}};
      if (guide) example.guide = guide->Maps(code, std::span(&example.condition, 1), config.GuideSize());
      examples.push_back(std::move(example));
    }
  }
  return examples;
}

void ShowVolume(const TensorFile& file, const std::string& model, const std::filesystem::path& meshes, int views) {
  const torch::InferenceMode inference;
  ViewVolume network(ViewVolumeConfig::FromMetadata(file.metadata, model));
  LoadWithBackbone(*network, file, model);
  const FeatureDistance distance_of;
  double own = 0, own_features = 0, copied = 0, copied_features = 0, count = 0;
  ShowViews(network, meshes, views, torch::kCPU, [&](const ShownView& view) {
    own += PeakSignalToNoise(view.shown, view.truth);
    own_features += distance_of(view.shown, view.truth);
    copied += PeakSignalToNoise(view.picture, view.truth);
    copied_features += distance_of(view.picture, view.truth);
    ++count;
  });
  std::printf("%-38s %5.1f dB to the rendering, features %.3f away\n", "the picture itself", copied / count, copied_features / count);
  std::printf("%-38s %5.1f dB to the rendering, features %.3f away\n", "the volume", own / count, own_features / count);
}

int Run(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: sampling_quality MODEL MESHES [VIEWS]\n");
    return 2;
  }
  at::set_num_threads(1);
  const TensorFile file = LoadModel(argv[1]);
  const int views = argc > 3 ? std::atoi(argv[3]) : 8;
  if (ViewVolumeConfig::IsIn(file.metadata)) {
    ShowVolume(file, argv[1], argv[2], views);
    return 0;
  }
  ViewDiffusion model(ViewDiffusionConfig::FromMetadata(file.metadata, argv[1]));
  LoadInto(*model, file, argv[1]);
  const std::optional<ViewGuide> guide = ViewGuide::Of(file.metadata, argv[1]);
  const std::vector<Example> examples = Render(argv[2], model->config(), guide, views);
  const FeatureDistance distance_of;
  const auto mean_over_examples = [&](const auto& value) {
    double sum = 0;
    for (std::size_t i = 0; i < examples.size(); ++i) sum += value(i);
    return sum / static_cast<double>(examples.size());
  };
  std::printf("%-38s %5.1f dB to the rendering, features %.3f away\n", "the picture itself",
              mean_over_examples([&](std::size_t i) { return PeakSignalToNoise(examples[i].picture, examples[i].view); }),
              mean_over_examples([&](std::size_t i) { return distance_of(examples[i].picture, examples[i].view); }));
  std::vector<torch::Tensor> reference;
  double reference_seconds = 0;
  for (const Way& way : Ways()) {
    const Stopwatch stopwatch;
    std::vector<torch::Tensor> sampled;
    for (std::size_t i = 0; i < examples.size(); ++i) {
      const std::vector<std::string> name{std::to_string(i)};
      sampled.push_back(model->SampleViews(examples[i].picture * 2 - 1, std::span(&examples[i].condition, 1), name, way.options, examples[i].guide));
    }
    const double seconds = stopwatch.Seconds();
    if (reference.empty()) {
      reference = sampled;
      reference_seconds = seconds;
    }
    std::printf("%-38s %5.1f dB to the rendering, features %.3f away, %5.1f dB to DDIM, %5.1f times as fast\n", way.name.c_str(),
                mean_over_examples([&](std::size_t i) { return PeakSignalToNoise(sampled[i], examples[i].view); }),
                mean_over_examples([&](std::size_t i) { return distance_of(sampled[i], examples[i].view); }),
                mean_over_examples([&](std::size_t i) { return PeakSignalToNoise(sampled[i], reference[i]); }), reference_seconds / seconds);
  }
  return 0;
}

}  // namespace
}  // namespace antipode

int main(int argc, char** argv) { return antipode::GuardedMain("sampling_quality", antipode::Run, argc, argv); }
