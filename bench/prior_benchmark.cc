// What the built-in prior takes: prior_benchmark PICTURE PICTURE [Google Benchmark options]
// Pictures are of an object on white, square or not. Encoding is of one picture, comparing of one pair of codes.

#include <cstdio>

#include <benchmark/benchmark.h>
#include <opencv2/imgproc.hpp>

#include "antipode/image/load.h"
#include "antipode/prior/object_prior.h"
#include "guarded_main.h"

namespace antipode {
namespace {

torch::Tensor InputOf(const char* file, int size) {
  ObjectView view;
  cv::resize(LoadImage(file).rgb, view.image, {size, size}, 0, 0, cv::INTER_AREA);
  return EncoderInput({&view, 1}, size);
}

int Run(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (argc < 3) {
    std::fprintf(stderr, "usage: prior_benchmark PICTURE PICTURE [benchmark options]\n");
    return 2;
  }
  const ObjectPrior prior = ObjectPrior::Load("prior");
  const int size = prior.ViewOptions().size;
  const torch::Tensor pictures = torch::cat({InputOf(argv[1], size), InputOf(argv[2], size)});
  const torch::Tensor codes = prior.EncodeImages(pictures);
  const auto encode = [&](benchmark::State& state) {
    at::set_num_threads(static_cast<int>(state.range(0)));
    for (auto _ : state) benchmark::DoNotOptimize(prior.EncodeImages(pictures.slice(0, 0, 1)));
  };
  const auto compare = [&](benchmark::State& state) {
    at::set_num_threads(static_cast<int>(state.range(0)));
    for (auto _ : state) benchmark::DoNotOptimize(prior.Compare(codes[0], codes[1]));
  };
  benchmark::RegisterBenchmark("EncodePicture/threads", encode)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("ComparePair/threads", compare)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace
}  // namespace antipode

int main(int argc, char** argv) { return antipode::GuardedMain("prior_benchmark", antipode::Run, argc, argv); }
