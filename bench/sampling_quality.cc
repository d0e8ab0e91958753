// sampling_quality MODEL MESHES [VIEWS]: what cheaper sampling costs a model that `antipode train views` wrote. Renders views of
// the meshes, lets the model imagine each from another one, and prints for each way of sampling: peak signal-to-noise ratio
// against the rendering and against 50 steps of DDIM, and how many times as fast it is. One thread.

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "antipode/nn/module_weights.h"
#include "antipode/training/augmentation.h"
#include "antipode/training/views_trainer.h"
#include "antipode/util/files.h"
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
  return {{"DDIM, 50 steps", {}}, {"the same, another seed", {.seed = 2}}, {"DPM-Solver++, 8 steps", guided},
          {"  guidance on half of them", full}, {"  deep levels at every second (fast)", fast}};
}

std::vector<Example> Render(const std::filesystem::path& meshes, int size, int views) {
  const TemporaryFolder folder;
  ViewCacheOptions options;
  options.views_per_object = views + 1;
  options.variants = 1;
  options.wide_share = 0;
  const std::vector<std::filesystem::path> files = FilesWithExtension(meshes, ".glb");
  const ViewCache cache = ViewCache::OpenOrRender(folder.path() / "cache", files, options, {});
  const auto plain = [&](int group, int view) {
    std::mt19937_64 random(1);
    const AugmentationOptions none{.crop_shift = 0, .crop_scale = 0, .mask_error_share = 0, .blur_share = 0};
    const AugmentedView augmented = AugmentView(cache, group, view, 0, false, size, none, random);
    return std::pair{OnWhite(augmented), augmented.camera_from_object};
  };
  std::vector<Example> examples;
  for (int group = 0; group < cache.group_count(); ++group) {
    const auto [picture, from] = plain(group, 0);
    for (int view = 1; view <= views; ++view) {
      const auto [truth, to] = plain(group, view);
      examples.push_back({picture, truth, {to * from.transpose(), {}}});
    }
  }
  return examples;
}

int Run(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: sampling_quality MODEL MESHES [VIEWS]\n");
    return 2;
  }
  at::set_num_threads(1);
  const TensorFile file = LoadModel(argv[1]);
  ViewDiffusion model(ViewDiffusionConfig::FromMetadata(file.metadata, argv[1]));
  LoadInto(*model, file, argv[1]);
  const std::vector<Example> examples = Render(argv[2], model->config().image_size, argc > 3 ? std::atoi(argv[3]) : 8);
  std::vector<torch::Tensor> reference;
  double reference_seconds = 0;
  for (const Way& way : Ways()) {
    double truth = 0, same = 0;
    const Stopwatch stopwatch;
    std::vector<torch::Tensor> sampled;
    for (std::size_t i = 0; i < examples.size(); ++i) {
      const std::vector<std::string> name{std::to_string(i)};
      sampled.push_back(model->SampleViews(examples[i].picture * 2 - 1, std::span(&examples[i].condition, 1), name, way.options));
    }
    const double seconds = stopwatch.Seconds();
    if (reference.empty()) {
      reference = sampled;
      reference_seconds = seconds;
    }
    for (std::size_t i = 0; i < examples.size(); ++i) {
      truth += PeakSignalToNoise(sampled[i], examples[i].view) / static_cast<double>(examples.size());
      same += PeakSignalToNoise(sampled[i], reference[i]) / static_cast<double>(examples.size());
    }
    std::printf("%-38s %5.1f dB to the rendering, %5.1f dB to DDIM, %5.1f times as fast\n", way.name.c_str(), truth, same,
                reference_seconds / seconds);
  }
  return 0;
}

}  // namespace
}  // namespace antipode

int main(int argc, char** argv) { return antipode::GuardedMain("sampling_quality", antipode::Run, argc, argv); }
