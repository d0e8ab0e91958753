#include <iostream>
#include <map>
#include <optional>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/photograph_input.h"
#include "antipode/cli/progress_line.h"
#include "antipode/cli/synthesis_request.h"
#include "antipode/nn/device.h"
#include "antipode/synthesis/reference_picture.h"
#include "antipode/synthesis/small_synthesizer.h"
#include "antipode/synthesis/view_folder.h"
#include "antipode/util/error.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/quote.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

/// What the command line may change of a preset.
struct SamplingRequest {
  std::string preset = "fast", precision = "auto";
  std::optional<std::string> solver;
  std::optional<int> steps;
  std::optional<double> guidance_scale, eta;

  Zero123Options Resolve(std::uint64_t seed) const {
    Zero123Options options = SamplingPreset(preset);
    if (solver) options.solver = SolverFromName(*solver);
    if (options.solver != Solver::kDdim) options.eta = 0;
    if (steps) options.steps = *steps;
    if (guidance_scale) options.guidance_scale = *guidance_scale;
    if (eta) options.eta = *eta;
    options.seed = seed;
    options.Check();
    return options;
  }
};

class SynthesizeCommand : public Command {
 public:
  std::string Name() const override { return "synthesize"; }
  std::string Summary() const override { return "Imagine the object in a picture from other viewpoints"; }
  std::string Example() const override {
    return "  antipode synthesize photo.png --views 32 --elevation 20 --out views\n"
           "Sharper, with the authors' weights:\n"
           "  antipode models import zero123 105000.ckpt";
  }

  void DeclareOptions(CLI::App& app) override {
    picture_.Declare(app, "image");
    app.add_option("--out", out_, "Folder for the pictures, views.json, transforms.json, colmap/ and contact_sheet.png; work "
                                  "that was interrupted goes on")
        ->required()->type_name("DIR");
    app.add_option("--elevation", elevation_deg_, "Elevation of the picture's own camera above the horizon, degrees; without: 0")
        ->type_name("DEG");
    app.add_option("--views", views_, "How many views of the upper half of the sphere: the paper's viewpoints")
        ->capture_default_str()->type_name("N");
    app.add_option("--elevations", elevations_deg_, "Instead, all combinations of these elevations..")->delimiter(',')->type_name("DEG,..");
    app.add_option("--azimuths", azimuths_deg_, ".. and azimuths; 0 is the picture's own, positive to the right")
        ->delimiter(',')->type_name("DEG,..");
    app.add_option("--model", model_, "Name of a model (see 'antipode models list') or its folder; auto: zero123 where it was imported, else the built-in volume")->capture_default_str()
        ->type_name("NAME|FOLDER");
    const char* const group = "Sampling";
    app.add_option("--preset", sampling_.preset, "fast, or paper: exactly as the paper's program samples")->capture_default_str()
        ->type_name("NAME")->group(group);
    app.add_option("--precision", sampling_.precision, "float32, bfloat16, or auto: bfloat16 for the preset fast where the processor has it")
        ->capture_default_str()->type_name("NAME")->group(group);
    app.add_option("--solver", sampling_.solver, "ddim, dpm++ or unipc")->type_name("NAME")->group(group);
    app.add_option("--steps", sampling_.steps, "Steps of the solver")->type_name("N")->group(group);
    app.add_option("--guidance-scale", sampling_.guidance_scale, "1: no guidance")->type_name("X")->group(group);
    app.add_option("--eta", sampling_.eta, "Noise added by ddim, 0 to 1")->type_name("X")->group(group);
    app.add_option("--batch", batch_, "Views at a time; memory grows with it")->capture_default_str()->type_name("N")->group(group);
    app.add_option("--memory-limit", memory_limit_gb_, "Take fewer views at a time than --batch where the program would need more memory; 0: "
                   "no limit")->capture_default_str()->type_name("GB")->group(group);
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    const std::vector<ViewRequest> requests = Requests();
    const Zero123SynthesisOptions options{sampling_.Resolve(common_.seed), batch_, PrecisionOf(sampling_.precision, sampling_.preset), memory_limit_gb_};
    options.Check();
    const std::string model = ChosenSynthesisModel(model_);
    const PhotographInput input = LoadPhotograph(picture_, "image");
    const ReferencePicture picture = MakeReferencePicture(input.photograph.image, input.photograph.mask, input.photograph.camera);
    const auto synthesizer = MakeDiffusionSynthesizer(model, picture.picture, options, SelectDevice(common_.device));
    ViewFolder folder(out_, synthesizer->Fingerprint());
    const std::vector<SynthesizedView> views = Synthesize(requests, *synthesizer, folder);
    folder.WriteOverviews(views);
    Report(views.size(), input);
  }

 private:
  std::vector<ViewRequest> Requests() const {
    const double elevation = elevation_deg_.value_or(0);
    if (elevations_deg_.empty() && azimuths_deg_.empty()) return RequestPredefinedViews(views_, elevation);
    if (elevations_deg_.empty() || azimuths_deg_.empty())
      throw InvalidOption("--elevations and --azimuths", "only work together", "give both");
    return RequestViews(elevations_deg_, azimuths_deg_, elevation);
  }

  std::vector<SynthesizedView> Synthesize(const std::vector<ViewRequest>& requests, const ViewSynthesizer& synthesizer,
                                          ViewFolder& folder) const {
    ProgressLine line(common_.ProgressMode());
    return FindOrMakeViews(synthesizer, requests, folder, [&](const Progress& progress) {
      ThrowIfInterrupted();
      line.Show(progress);
    });
  }

  void Report(std::size_t count, const PhotographInput& input) const {
    std::vector<std::string> warnings = input.warnings;
    if (!elevation_deg_) warnings.emplace_back("the picture's elevation is taken to be 0 degrees; give --elevation");
    if (const auto coarse = WarningOfCoarseViews(model_)) warnings.push_back(*coarse);
    common_.WriteJson({{"views", count}, {"folder", out_}, {"warnings", warnings}});
    if (!common_.PrintsText()) return;
    std::cout << count << " views in " << out_ << "; contact_sheet.png shows them all\n";
    for (const std::string& warning : warnings) std::cout << "  warning      " << warning << "\n";
  }

  PhotographRequest picture_;
  std::string out_, model_ = "auto";
  std::optional<double> elevation_deg_;
  int views_ = 32, batch_ = 4;
  double memory_limit_gb_ = 0;
  std::vector<double> elevations_deg_, azimuths_deg_;
  SamplingRequest sampling_;
  CommonOptions common_;
};

}  // namespace

std::unique_ptr<Command> MakeSynthesizeCommand() { return std::make_unique<SynthesizeCommand>(); }

}  // namespace antipode
