// Views a second of the renderer: render_benchmark FOLDER_OF_GLB [Google Benchmark options]
#include <cstdio>
#include <filesystem>
#include <random>
#include <vector>

#include <benchmark/benchmark.h>

#include "antipode/geometry/look_at.h"
#include "antipode/render/renderer.h"
#include "antipode/util/files.h"
#include "guarded_main.h"

namespace antipode {
namespace {

constexpr std::size_t kMeshes = 20;

/// Meshes spread evenly over the sorted folder.
std::vector<Renderer> LoadRenderers(const std::filesystem::path& folder) {
  const auto files = FilesWithExtension(folder, ".glb");
  std::vector<Renderer> renderers;
  for (std::size_t i = 0; i < kMeshes; ++i) {
    renderers.emplace_back(LoadMesh(files[i * files.size() / kMeshes]));
  }
  return renderers;
}

/// Whole views, each thread its own, over all meshes in turn.
void RenderViews(benchmark::State& state, const std::vector<Renderer>& renderers) {
  const auto size = static_cast<int>(state.range(0));
  const auto camera = PinholeCamera::FromFieldOfView(size, size, 50);
  std::mt19937 generator(state.thread_index());
  std::uniform_real_distribution<double> azimuth(0, 360), elevation(-30, 60);
  std::size_t next = state.thread_index();
  for (auto _ : state) {
    const Rigid3 pose = CameraFromObject(
        {.azimuth = azimuth(generator), .elevation = elevation(generator), .distance = 2.6});
    benchmark::DoNotOptimize(renderers[next++ % renderers.size()].Render(camera, pose));
  }
  state.SetItemsProcessed(state.iterations());
}

int Run(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: render_benchmark FOLDER_OF_GLB [benchmark options]\n");
    return 2;
  }
  const std::vector<Renderer> renderers = LoadRenderers(argv[1]);
  benchmark::Initialize(&argc, argv);
  benchmark::RegisterBenchmark("RenderViews",
                               [&](benchmark::State& state) { RenderViews(state, renderers); })
      ->Arg(128)
      ->Arg(256)
      ->Threads(1)
      ->Threads(2)
      ->UseRealTime()
      ->Unit(benchmark::kMillisecond);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace
}  // namespace antipode

int main(int argc, char** argv) { return antipode::GuardedMain("render_benchmark", antipode::Run, argc, argv); }
