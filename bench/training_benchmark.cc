// Pictures a second that training can be fed with: training_benchmark FOLDER_OF_GLB [Google Benchmark options]. With taskset -c 0: of one core.
#include <cstdio>

#include <benchmark/benchmark.h>
#include <torch/torch.h>

#include "antipode/training/augmentation.h"
#include "antipode/training/batch_loader.h"
#include "antipode/training/view_cache.h"
#include "antipode/util/temporary_folder.h"
#include "guarded_main.h"

namespace antipode {
namespace {

constexpr int kObjects = 8, kViews = 8, kSize = 128;
constexpr std::uint64_t kSeed = 1;

/// Drawing, turning and cropping views, in a thread of its own for every batch.
void MakeBatches(benchmark::State& state, const ViewCache& cache) {
  BatchLoader loader(cache, kObjects, kViews, kSize, {}, kSeed);
  std::int64_t index = 0;
  for (auto _ : state) benchmark::DoNotOptimize(loader.Get(index++));
  state.SetItemsProcessed(state.iterations() * kObjects * kViews);
}

void ChangeColors(benchmark::State& state, const ViewCache& cache) {
  const ViewBatch batch = BatchLoader(cache, kObjects, kViews, kSize, {}, kSeed).Get(0);
  const torch::Tensor rgba = batch.rgba.to(torch::kFloat) / 255;
  std::uint64_t seed = 0;
  for (auto _ : state) benchmark::DoNotOptimize(AugmentColors(rgba, batch.groups, {}, seed++));
  state.SetItemsProcessed(state.iterations() * rgba.size(0));
}

int Run(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: training_benchmark FOLDER_OF_GLB [benchmark options]\n");
    return 2;
  }
  at::set_num_threads(1);
  const TemporaryFolder folder;
  const ViewCache cache =
      ViewCache::OpenOrRender(folder.path() / "cache", MeshCollection::Open(argv[1]), {.views_per_object = kViews, .variants = 1}, {});
  benchmark::Initialize(&argc, argv);
  benchmark::RegisterBenchmark("MakeBatches", [&](benchmark::State& state) { MakeBatches(state, cache); })->UseRealTime();
  benchmark::RegisterBenchmark("ChangeColors", [&](benchmark::State& state) { ChangeColors(state, cache); })->UseRealTime();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace
}  // namespace antipode

int main(int argc, char** argv) { return antipode::GuardedMain("training_benchmark", antipode::Run, argc, argv); }
