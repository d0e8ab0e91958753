#include <future>
#include <iostream>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/photograph_input.h"
#include "antipode/cli/pose_methods.h"
#include "antipode/cli/pose_result.h"
#include "antipode/cli/process_clock.h"
#include "antipode/cli/progress_line.h"
#include "antipode/image/load.h"
#include "antipode/matching/matchers.h"
#include "antipode/nn/device.h"
#include "antipode/pose/object_pose.h"
#include "antipode/report/pose_picture.h"
#include "antipode/util/error.h"
#include "antipode/util/interrupt.h"

namespace antipode {
namespace {

class PoseCommand : public Command {
 public:
  std::string Name() const override { return "pose"; }
  std::string Summary() const override { return "Relative camera pose of two photographs of one object"; }
  std::string Example() const override {
    return "  antipode pose front.jpg back.jpg --reference-mask front_mask.png --query-mask back_mask.png "
           "--visualize pose.png\n"
           "Without masks: pictures with an alpha channel or a uniform background, or a box around the object:\n"
           "  antipode pose front.jpg back.jpg --reference-box 210,80,400,380 --query-box 190,75,420,390 --json -\n"
           "With the object's mesh, or a folder of 'antipode reference build' for many queries:\n"
           "  antipode pose front.jpg back.jpg --mesh object.glb\n"
           "  antipode pose reference_folder back.jpg";
  }

  void DeclareOptions(CLI::App& app) override {
    reference_.Declare(app, "reference");
    query_.Declare(app, "query");
    method_.Declare(app);
    app.add_option("--hypotheses", method_.options.hypotheses, "How many poses to list at most, 1 to 50")
        ->capture_default_str()->type_name("N");
    app.add_option("--object-size", object_size_,
                   "Diameter of the object in metres; translations are then in metres instead of object radii")
        ->type_name("METRES");
    app.add_option("--visualize", picture_, "Draw the result into a PNG or JPEG picture")->type_name("FILE");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    if (!method_.synthesis.mesh.empty() && method_.method == "auto") method_.method = "diffusion";
    Check();
    const PoseResult result = IsReferenceFolder(reference_.path) ? EstimateAgainstFolder() : Estimate();
    ThrowIfInterrupted();
    if (picture_) {
      SaveImage(*picture_, DrawPosePicture(result.pose, result.reference.photograph, result.query.photograph));
    }
    common_.WriteJson(ToJson(result));
    if (common_.PrintsText()) Print(result);
  }

 private:
  void Check() const {
    method_.options.Check();
    if (object_size_ && !(*object_size_ > 0 && std::isfinite(*object_size_)))
      throw InvalidOption("--object-size", "is not a positive number", "give the object's diameter in metres");
    if (picture_ && IsReferenceFolder(reference_.path))
      throw InvalidOption("--visualize", "needs two photographs", "leave it out for a reference folder");
  }

  PoseResult Estimate() const {
    MethodRequest request = method_;
    request.device = common_.device;
    request.synthesis.seed = common_.seed;
    ProgressLine line(common_.ProgressMode());
    request.progress = [&](const Progress& progress) { line.Show(progress); };
    auto method_loading = std::async(std::launch::async, [&] { return LoadPoseMethod(request); });
    auto query_loading = std::async(std::launch::async, [&] { return LoadPhotograph(query_, "query"); });
    PoseResult result;
    result.method = method_.method;
    result.model = method_.model;
    result.object_size = object_size_;
    result.reference = LoadPhotograph(reference_, "reference");
    result.query = query_loading.get();
    const PoseMethod method = method_loading.get();
    ThrowIfInterrupted();
    result.load_seconds = SecondsSinceProcessStart();
    const SceneView reference{"reference", result.reference.photograph, {}}, query{"query", result.query.photograph, {}};
    result.pose = method.estimate({"photographs", reference, query});
    WarnOfUnusedDepth(result.pose);
    result.total_seconds = SecondsSinceProcessStart();
    return result;
  }

  PoseResult EstimateAgainstFolder() const {
    PoseResult result;
    result.method = "diffusion";
    result.model = method_.model;
    result.object_size = object_size_;
    result.reference.path = reference_.path;
    result.query = LoadPhotograph(query_, "query");
    const ReferenceModels models = ReferenceModels::Load(method_.model, common_.device);
    const Reference reference = LoadReference(reference_.path, models.identity);
    const auto matcher = MakeMatcher(method_.MatcherFor("diffusion"), SelectDevice(common_.device));
    ViewComparison comparison = method_.comparison.Load(SelectDevice(common_.device));
    ProgressLine line(common_.ProgressMode());
    const std::vector<std::string> warnings = comparison.Prepare(reference, reference_.path, [&](const Progress& progress) {
      ThrowIfInterrupted();
      line.Show(progress);
    });
    ThrowIfInterrupted();
    result.load_seconds = SecondsSinceProcessStart();
    const ObjectPoseModels pose_models{models.prior.get(), matcher.get(), method_.comparison.IsWanted() ? &comparison : nullptr};
    const ObjectPoseOptions options{.hypotheses = method_.options.hypotheses,
                                    .refine_iterations = method_.comparison.refine_iterations,
                                    .matching = method_.options.matching};
    result.pose = RelativeToSource(reference, EstimateObjectPose(reference, pose_models, result.query.photograph, options));
    if (!reference.source_from_object)
      result.pose.warnings.emplace_back("the reference comes from a mesh: the pose is that of the mesh's frame in the query camera");
    for (const auto& more : {reference.warnings, warnings}) result.pose.warnings.insert(result.pose.warnings.end(), more.begin(), more.end());
    result.total_seconds = SecondsSinceProcessStart();
    return result;
  }

  void WarnOfUnusedDepth(TwoViewPose& pose) const {
    if ((reference_.depth || query_.depth) && pose.length_unit != LengthUnit::kDepth)
      pose.warnings.push_back("depth is not used by --method " + method_.method + "; try --method sift+depth-pnp");
  }

  void Print(const PoseResult& result) const {
    std::cout << ToText(result);
    if (picture_) {
      std::cout << "\nPicture: " << *picture_ << "\n";
    } else {
      std::cout << "\nNext: add --visualize pose.png to see the pose, or --json pose.json to use it.\n";
    }
  }

  PhotographRequest reference_, query_;
  MethodRequest method_;
  std::optional<double> object_size_;
  std::optional<std::string> picture_;
  CommonOptions common_;
};

}  // namespace

std::unique_ptr<Command> MakePoseCommand() { return std::make_unique<PoseCommand>(); }

}  // namespace antipode
