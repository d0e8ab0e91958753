#include <iostream>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/photograph_input.h"
#include "antipode/cli/progress_line.h"
#include "antipode/cli/synthesis_request.h"
#include "antipode/matching/matchers.h"
#include "antipode/nn/device.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/suggest.h"

namespace antipode {
namespace {

class OrientCommand : public Command {
 public:
  std::string Name() const override { return "orient"; }
  std::string Summary() const override { return "Elevation and in-plane rotation of the camera of a picture"; }
  std::string Example() const override {
    return "  antipode orient photo.jpg --image-mask mask.png\n"
           "  antipode orient photo.jpg --image-mask mask.png --search     with imagined nearby views, as in the paper";
  }

  void DeclareOptions(CLI::App& app) override {
    picture_.Declare(app, "image");
    app.add_option("--model", prior_, "The prior: name of a model or its folder")->capture_default_str()->type_name("NAME|FOLDER");
    app.add_flag("--search", search_, "Imagine nearby views and search, instead of asking the prior's code; minutes to hours");
    app.add_option("--matcher", matcher_, "For --search: " + JoinNames(MatcherNames()))->capture_default_str()->type_name("NAME");
    synthesis_.Declare(app, "For --search");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    const PhotographInput input = LoadPhotograph(picture_, "image");
    synthesis_.seed = common_.seed;
    synthesis_.device = common_.device;
    const Orientation orientation = search_ ? Search(input.photograph) : Ask(input.photograph);
    Report(orientation, input);
  }

 private:
  Orientation Ask(const ObjectPhotograph& photograph) const {
    SynthesisRequest nothing_given;
    return OrientPhotograph(nothing_given, ReferenceModels::Load(prior_, common_.device), photograph).orientation;
  }

  Orientation Search(const ObjectPhotograph& photograph) const {
    synthesis_.Check();
    const auto matcher = MakeMatcher(matcher_, SelectDevice(common_.device));
    ProgressLine line(common_.ProgressMode());
    return SearchOrientation([&](double turn_deg) { return SynthesizerOf(synthesis_, photograph, turn_deg); }, *matcher, {},
                             [&](const Progress& progress) {
                               ThrowIfInterrupted();
                               line.Show(progress);
                             });
  }

  void Report(const Orientation& orientation, const PhotographInput& input) const {
    common_.WriteJson({{"elevation_deg", orientation.elevation_deg},
                       {"in_plane_rotation_deg", orientation.in_plane_rotation_deg},
                       {"certainty", orientation.certainty},
                       {"source", orientation.source},
                       {"image", ToJson(input)},
                       {"warnings", input.warnings}});
    if (!common_.PrintsText()) return;
    std::cout << Formatted("  elevation          %6.1f degrees: the camera looks %s\n", orientation.elevation_deg,
                           orientation.elevation_deg >= 0 ? "down on the object" : "up at the object")
              << Formatted("  in-plane rotation  %6.1f degrees: the picture is turned %s\n", orientation.in_plane_rotation_deg,
                           orientation.in_plane_rotation_deg >= 0 ? "clockwise" : "counter-clockwise")
              << Formatted("  certainty          %5.0f %%\n", 100 * orientation.certainty);
    for (const std::string& warning : input.warnings) std::cout << "  warning      " << warning << "\n";
  }

  PhotographRequest picture_;
  std::string prior_ = "prior", matcher_ = "xfeat-lighterglue";
  bool search_ = false;
  SynthesisRequest synthesis_;
  CommonOptions common_;
};

}  // namespace

std::unique_ptr<Command> MakeOrientCommand() { return std::make_unique<OrientCommand>(); }

}  // namespace antipode
