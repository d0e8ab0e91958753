#include "antipode/zero123/checkpoint_import.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "antipode/nn/module_weights.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"
#include "antipode/util/temporary_folder.h"
#include "antipode/weights/test_pickles.h"
#include "antipode/zero123/test_config.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;
using torch::Tensor;
using Tensors = std::map<std::string, Tensor>;

/// By their names in the registry.
Tensors TinyWeights() {
  Tensors weights;
  for (const auto& [name, shape] : Zero123Tensors(TinyZero123())) weights[name] = SyntheticUniform(name, shape).to(torch::kFloat);
  return weights;
}

std::string OriginalName(const std::string& name) {
  const std::string part = name.substr(0, name.find('.') + 1), inner = name.substr(part.size());
  if (part == "unet.") return "model.diffusion_model." + inner;
  if (part == "autoencoder.") return "first_stage_model." + inner;
  return part == "clip." ? "cond_stage_model.model." + inner : inner;
}

Tensors Renamed(const Tensors& weights) {
  Tensors renamed;
  for (const auto& [name, tensor] : weights) renamed[OriginalName(name)] = tensor;
  return renamed;
}

class CheckpointImport : public testing::Test {
 protected:
  /// As torch.save writes {"state_dict": tensors, "callbacks": ..}.
  fs::path WriteOriginal(const Tensors& tensors) const {
    namespace pickle = test_pickles;
    std::map<std::string, std::string> entries, files;
    for (const auto& [name, tensor] : tensors) {
      const Tensor values = tensor.contiguous();
      const std::string key = std::to_string(files.size());
      entries[name] = pickle::View(pickle::Storage(key, values.numel()), 0, values.sizes().vec(), values.strides().vec());
      files["archive/data/" + key] = std::string(static_cast<const char*>(values.const_data_ptr()), values.nbytes());
    }
    const std::string callback = pickle::Call(pickle::Global("pytorch_lightning.callbacks", "ModelCheckpoint"), ")");
    files["archive/data.pkl"] = pickle::WholePickle(pickle::Dict({{"state_dict", pickle::Dict(entries)}, {"callbacks", callback}}));
    pickle::WriteZip(checkpoint_, files);
    return checkpoint_;
  }

  /// One folder a network.
  fs::path WriteDiffusers(const Tensors& weights) const {
    std::map<std::string, TensorFile> networks;
    const auto put = [&](const std::string& path, const Tensor& tensor) {
      const std::size_t slash = path.find('/');
      networks[path.substr(0, slash)].tensors[path.substr(slash + 1)] = FromTorch(tensor);
    };
    for (const auto& [name, tensor] : weights) {
      if (name.find("in_proj_") == std::string::npos) {
        put(DiffusersName(name, TinyZero123()), name == "clip.visual.proj" ? tensor.t() : tensor);
        continue;
      }
      const auto rows = tensor.chunk(3);
      for (std::size_t i = 0; i < 3; ++i) put(DiffusersName(name, TinyZero123(), std::string(1, "qkv"[i])), rows[i]);
    }
    for (const auto& [network, file] : networks) {
      fs::create_directories(folder_.path() / "diffusers" / network);
      WriteSafetensors(folder_.path() / "diffusers" / network / "diffusion_pytorch_model.safetensors", file);
    }
    return folder_.path() / "diffusers";
  }

  static void ExpectWeights(const LazyTensorFile& file, const Tensors& weights) {
    ASSERT_EQ(file.tensors.size(), weights.size());
    for (const auto& [name, tensor] : weights) {
      ASSERT_TRUE(file.tensors.contains(name)) << name;
      EXPECT_TRUE(torch::equal(ToTorch(file.tensors.at(name).read()), tensor)) << name;
    }
  }

  static std::string Refusal(const std::function<void()>& open) {
    try {
      open();
    } catch (const BadFile& error) {
      return error.what();
    }
    return "";
  }

  std::string RefusalOf(const Tensors& tensors) const {
    return Refusal([&] { OpenZero123Checkpoint(WriteOriginal(tensors), options_); });
  }

  TemporaryFolder folder_;
  fs::path checkpoint_ = folder_.path() / "105000.ckpt";
  Zero123ImportOptions options_{.dtype = Dtype::kF32, .config = TinyZero123()};
};

TEST_F(CheckpointImport, TakesTheNeededTensorsOfAnOriginalCheckpoint) {
  const Tensors weights = TinyWeights();
  Tensors tensors = Renamed(weights);
  tensors["betas"] = torch::ones(1000);  // of the schedule: not needed
  ExpectWeights(OpenZero123Checkpoint(WriteOriginal(tensors), options_), weights);
}

TEST_F(CheckpointImport, TakesTheMovingAverageWhenAsked) {
  Tensors weights = TinyWeights();
  Tensors tensors = Renamed(weights);
  for (auto& [name, tensor] : weights) {
    if (!name.starts_with("unet.")) continue;
    std::string average = OriginalName(name).substr(std::string("model.").size());
    std::erase(average, '.');
    tensor = tensor + 1;
    tensors["model_ema." + average] = tensor;
  }
  options_.unet_weights = UnetWeights::kMovingAverage;
  ExpectWeights(OpenZero123Checkpoint(WriteOriginal(tensors), options_), weights);
  EXPECT_NE(RefusalOf(Renamed(weights)).find("no moving average"), std::string::npos);
}

TEST_F(CheckpointImport, TakesAFolderInTheLayoutOfDiffusers) {
  const Tensors weights = TinyWeights();
  ExpectWeights(OpenZero123Checkpoint(WriteDiffusers(weights), options_), weights);
}

TEST_F(CheckpointImport, ConvertsToHalfPrecision) {
  options_.dtype = Dtype::kF16;
  const Tensors weights = TinyWeights();
  const LazyTensorFile file = OpenZero123Checkpoint(WriteOriginal(Renamed(weights)), options_);
  const auto& [name, tensor] = *weights.begin();
  EXPECT_TRUE(torch::equal(ToTorch(file.tensors.at(name).read()), tensor.to(torch::kHalf)));
}

TEST_F(CheckpointImport, NamesTheTensorThatIsNotFinite) {
  Tensors tensors = Renamed(TinyWeights());
  const std::string name = "model.diffusion_model.out.2.bias";
  tensors.at(name)[0] = std::nan("");
  const LazyTensorFile file = OpenZero123Checkpoint(WriteOriginal(tensors), options_);
  EXPECT_NE(Refusal([&] { file.tensors.at("unet.out.2.bias").read(); }).find("unet.out.2.bias"), std::string::npos);
}

TEST_F(CheckpointImport, NamesOtherFamiliesOfModels) {
  const Tensor any = torch::zeros({4, 4, 3, 3});
  const std::string unet = "model.diffusion_model.input_blocks.0.0.weight";
  EXPECT_NE(RefusalOf({{unet, any}, {"cond_stage_model.transformer.text_model.final_layer_norm.bias", any}}).find("text-to-image Stable Diffusion 1"),
            std::string::npos);
  EXPECT_NE(RefusalOf({{unet, any}, {"conditioner.embedders.0.a", any}}).find("Stable Diffusion XL"), std::string::npos);
  EXPECT_NE(RefusalOf({{"matcher.backbone.conv1.weight", any}}).find("LoFTR"), std::string::npos);
  EXPECT_NE(RefusalOf({{"fc.weight", any}}).find("holds no diffusion model"), std::string::npos);
}

TEST_F(CheckpointImport, ListsWhatIsMissingWronglyShapedOrSurplus) {
  Tensors tensors = Renamed(TinyWeights());
  tensors.erase("first_stage_model.quant_conv.bias");
  tensors["cond_stage_model.model.visual.proj"] = torch::zeros({3, 3});
  tensors["model.diffusion_model.extra"] = torch::zeros({1});
  const std::string refusal = RefusalOf(tensors);
  for (const char* const name : {"first_stage_model.quant_conv.bias", "visual.proj", "model.diffusion_model.extra"})
    EXPECT_NE(refusal.find(name), std::string::npos) << refusal;
}

TEST_F(CheckpointImport, RefusesATruncatedFile) {
  const fs::path path = WriteOriginal(Renamed(TinyWeights()));
  fs::resize_file(path, fs::file_size(path) / 2);
  EXPECT_NE(Refusal([&] { OpenZero123Checkpoint(path, options_); }), "");
}

}  // namespace
}  // namespace antipode
