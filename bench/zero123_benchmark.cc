// zero123_benchmark THREADS [FOLDER]: the guided step of Zero123 with synthetic weights, for zero123_peer.py.
// With FOLDER, writes the same weights there first, as diffusers names them. Then answers lines "general", "constant",
// "shallow" or, last, "bfloat16": the milliseconds of one denoising step of 8 views with guidance.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>

#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/zero123/checkpoint_import.h"
#include "guarded_main.h"

namespace antipode {
namespace {

constexpr std::int64_t kViews = 8, kSide = 32;

void WriteForDiffusers(const Zero123& model, const std::filesystem::path& folder) {
  LazyTensorFile file;
  for (const auto& item : model.unet->named_parameters()) {
    const std::string name = DiffusersName("unet." + item.key(), {});
    file.tensors[name.substr(name.find('/') + 1)] = {Dtype::kF32, item.value().sizes().vec(),
                                                     [tensor = item.value()] { return FromTorch(tensor); }};
  }
  WriteSafetensors(folder / "diffusion_pytorch_model.safetensors", file);
}

class Steps {
 public:
  explicit Steps(Zero123& model)
      : model_(model), x_(SyntheticUniform("x", {2 * kViews, 8, kSide, kSide}).to(torch::kFloat)),
        tokens_(SyntheticUniform("tokens", {2 * kViews, 1, 768}).to(torch::kFloat)),
        general_(model.unet->Prepare(tokens_, ContextPath::kGeneral)), constant_(model.unet->Prepare(tokens_)) {}

  torch::Tensor Run(const std::string& kind) {
    const auto time = torch::full({1}, 500.0);
    if (kind == "bfloat16") {
      ToBFloat16();
      return model_.unet->forward(x_, time, constant_);
    }
    if (kind == "general") return model_.unet->forward(x_, time.expand({2 * kViews}), general_);
    if (kind == "shallow" && cache_.deep.defined()) return model_.unet->ForwardShallow(x_, time, constant_, cache_);
    return model_.unet->ForwardAndKeep(x_, time, constant_, cache_);
  }

 private:
  /// For good.
  void ToBFloat16() {
    if (constant_.tokens.scalar_type() == torch::kBFloat16) return;
    model_.unet->to(torch::kBFloat16);
    UseChannelsLast(*model_.unet);
    constant_ = model_.unet->Prepare(tokens_);
  }

  Zero123& model_;
  torch::Tensor x_, tokens_;
  UnetContext general_, constant_;
  UnetCache cache_;
};

int Run(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: zero123_benchmark THREADS [FOLDER]\n");
    return 2;
  }
  const torch::InferenceMode inference;
  at::set_num_threads(std::atoi(argv[1]));
  Zero123 model;
  FillSynthetic(*model.unet);
  if (argc > 2) WriteForDiffusers(model, argv[2]);
  UseChannelsLast(*model.unet);
  Steps steps(model);
  std::cout << "ready" << std::endl;
  for (std::string kind; std::cin >> kind;) {
    const auto begin = std::chrono::steady_clock::now();
    const auto noise = steps.Run(kind);
    const std::chrono::duration<double, std::milli> spent = std::chrono::steady_clock::now() - begin;
    std::cout << spent.count() << ' ' << noise.slice(0, kViews).abs().mean().item<double>() << std::endl;
  }
  return 0;
}

}  // namespace
}  // namespace antipode

int main(int argc, char** argv) { return antipode::GuardedMain("zero123_benchmark", antipode::Run, argc, argv); }
