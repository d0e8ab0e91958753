#include <iostream>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/photograph_input.h"
#include "antipode/cli/progress_line.h"
#include "antipode/cli/synthesis_request.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"

namespace antipode {
namespace {

class ReferenceBuildCommand : public Command {
 public:
  std::string Name() const override { return "build"; }
  std::string Summary() const override { return "From a photograph or a mesh"; }
  std::string Example() const override {
    return "  antipode reference build --mesh object.glb --out reference\n"
           "  antipode reference build photo.jpg --image-mask mask.png --out reference\n"
           "  antipode pose reference query.jpg --query-mask query_mask.png";
  }

  void DeclareOptions(CLI::App& app) override {
    picture_.Declare(app, "image");
    app.get_option("IMAGE")->required(false)->description("Photograph of the object; not needed with --mesh");
    app.add_option("--out", folder_, "Folder of the reference; work that was interrupted goes on")->required()->type_name("DIR");
    app.add_option("--model", prior_, "The prior: name of a model or its folder")->capture_default_str()->type_name("NAME|FOLDER");
    synthesis_.Declare(app);
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    if (picture_.path.empty() && synthesis_.mesh.empty())
      throw InvalidOption("IMAGE", "is missing", "give a photograph of the object or --mesh object.glb");
    synthesis_.seed = common_.seed;
    synthesis_.device = common_.device;
    synthesis_.Check();
    std::optional<PhotographInput> input;
    if (synthesis_.mesh.empty()) input = LoadPhotograph(picture_, "image");
    const ReferenceModels models = ReferenceModels::Load(prior_, common_.device);
    Report(Build(models, input ? &input->photograph : nullptr));
  }

 private:
  Reference Build(const ReferenceModels& models, const ObjectPhotograph* photograph) const {
    ProgressLine line(common_.ProgressMode());
    return BuildReference(synthesis_, models, photograph, folder_, [&](const Progress& progress) {
      ThrowIfInterrupted();
      line.Show(progress);
    });
  }

  void Report(const Reference& reference) const {
    common_.WriteJson({{"folder", folder_}, {"views", reference.views.size()}, {"warnings", reference.warnings}});
    if (!common_.PrintsText()) return;
    std::cout << reference.views.size() << " views in " << folder_ << "; contact_sheet.png shows them\n";
    for (const std::string& warning : reference.warnings) std::cout << "  warning      " << warning << "\n";
    std::cout << "\nNext: antipode pose " << folder_ << " query.jpg\n";
  }

  PhotographRequest picture_;
  std::string folder_, prior_ = "prior";
  SynthesisRequest synthesis_;
  CommonOptions common_;
};

class ReferenceInfoCommand : public Command {
 public:
  std::string Name() const override { return "info"; }
  std::string Summary() const override { return "What a folder holds"; }
  std::string Example() const override { return "  antipode reference info reference"; }

  void DeclareOptions(CLI::App& app) override {
    app.add_option("FOLDER", folder_, "Folder of the reference")->required()->type_name("DIR");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    const ReferenceInfo info = ReadReferenceInfo(folder_);
    const char* const source = info.source_from_object ? "photograph" : "mesh";
    common_.WriteJson({{"folder", folder_}, {"antipode", info.antipode_version}, {"views", info.views}, {"source", source},
                       {"fingerprint", info.fingerprint}, {"prior_sha256", info.prior_sha256}, {"warnings", info.warnings}});
    if (!common_.PrintsText()) return;
    std::cout << Formatted("%d views, built by antipode %s from a %s\n", info.views, info.antipode_version.c_str(), source);
    for (const std::string& warning : info.warnings) std::cout << "  warning      " << warning << "\n";
  }

 private:
  std::string folder_;
  CommonOptions common_;
};

class ReferenceCommand : public Command {
 public:
  std::string Name() const override { return "reference"; }
  std::string Summary() const override { return "Build an object's posed views once, for many queries"; }
  std::string Example() const override { return "  antipode reference build --mesh object.glb --out reference"; }
  void DeclareOptions(CLI::App&) override {}
  void Run() override {}
  std::vector<std::unique_ptr<Command>> Subcommands() const override {
    std::vector<std::unique_ptr<Command>> commands;
    commands.push_back(std::make_unique<ReferenceBuildCommand>());
    commands.push_back(std::make_unique<ReferenceInfoCommand>());
    return commands;
  }
};

}  // namespace

std::unique_ptr<Command> MakeReferenceCommand() { return std::make_unique<ReferenceCommand>(); }

}  // namespace antipode
