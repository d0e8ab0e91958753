#include <algorithm>
#include <iostream>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/pose_methods.h"
#include "antipode/cli/progress_line.h"
#include "antipode/evaluation/dataset.h"
#include "antipode/evaluation/degraded_pictures.h"
#include "antipode/evaluation/dilated_masks.h"
#include "antipode/evaluation/evaluation.h"
#include "antipode/evaluation/evaluation_files.h"
#include "antipode/evaluation/evaluation_summary.h"
#include "antipode/evaluation/false_confidence.h"
#include "antipode/evaluation/orientation_evaluation.h"
#include "antipode/geometry/pose_metrics.h"
#include "antipode/matching/matchers.h"
#include "antipode/nn/device.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr double kRotatedDeg = 45;
constexpr double kSure = 0.5;  // a confidence above it is a claim

class EvaluateCommand : public Command {
 public:
  std::string Name() const override { return "evaluate"; }
  std::string Summary() const override { return "Accuracy on objects or photographs with known poses"; }
  std::string Example() const override {
    return "  antipode evaluate --dataset objects --root meshes --split test --out results\n"
           "  antipode evaluate --dataset photos --root photos --method auto,prior,matching,sift --out results";
  }

  void DeclareOptions(CLI::App& app) override {
    app.add_option("--dataset", dataset_, "objects: meshes, rendered; photos: pictures with a cameras.json")
        ->required()->type_name("objects|photos");
    app.add_option("--root", root_, "Folder of the data set")->required()->type_name("DIR");
    app.add_option("--split", split_, "Use this folder in the root, for example test")->type_name("NAME");
    method_.Declare(app);
    app.get_option("--method")
        ->description("One or more, separated by commas: auto, prior, matching, diffusion, the name of a matcher, "
                      "MATCHER+depth-pnp, MATCHER+depth-procrustes, predictions=FILE.csv")
        ->type_name("NAMES");
    app.add_option("--out", out_, "Folder for pairs.csv, summary.json and table.md; with several methods, one folder for each")
        ->type_name("DIR");
    app.add_option("--views", protocol_.views, "Views of each object: one reference, the others are queries")
        ->capture_default_str()->type_name("N")->group("Data set objects");
    app.add_option("--image-size", protocol_.image_size, "Side of the pictures, pixels")->capture_default_str()
        ->type_name("N")->group("Data set objects");
    app.add_flag("--rotated", rotated_, "Roll every camera by -45 to 45 degrees")->group("Data set objects");
    app.add_option("--pairs", options_.pairs_per_object, "At most so many pairs of each object, drawn with --seed")
        ->type_name("N");
    app.add_option("--dilate-masks", dilation_percent_, "Make the masks imprecise: dilate them by a square of so many percent of the "
                                                        "picture's shorter side")
        ->type_name("PERCENT");
    app.add_option("--degrade", degradation_, "Make the pictures worse: motion-blur, noise, jpeg, or cut-off by the picture's border")
        ->type_name("NAME");
    app.add_option("--different-objects", different_objects_,
                   "Instead of accuracy, measure the confidence on N pairs that show two different objects")
        ->type_name("N");
    app.add_option("--sweep", sweep_, "The route diffusion with 8 to 128 reference views, or with 0 to 3 refinement steps")
        ->type_name("views|iterations");
    app.add_option("--orientation", orientation_views_,
                   "Instead of poses, measure the camera's elevation and in-plane rotation on N views of each object: from the "
                   "prior's code, and by the search with the object's mesh as synthesiser")
        ->type_name("N");
    app.add_flag("--check-swap", options_.check_swap, "Also estimate every pair the other way round");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    std::unique_ptr<Dataset> dataset = OpenDataset();
    if (dilation_percent_ != 0) dataset = std::make_unique<DilatedMasks>(std::move(dataset), dilation_percent_ / 100);
    if (degradation_) dataset = std::make_unique<DegradedPictures>(std::move(dataset), DegradationNamed(*degradation_));
    MethodRequest request = method_;
    request.device = common_.device;
    request.synthesis.seed = common_.seed;
    if (dataset_ == "objects") request.object_meshes = Folder();
    if (orientation_views_) return ReportOrientation(*dataset);
    const std::vector<PoseMethod> methods = sweep_ ? LoadSweep(request, *sweep_) : LoadPoseMethods(request);
    if (methods.empty()) throw InvalidOption("--method", "is empty", "name at least one method");
    if (different_objects_) return ReportFalseConfidence(*dataset, methods);
    const std::vector<EvaluationResult> results = Evaluate(*dataset, methods);
    if (results.size() == 1) {
      ReportOne(results.front());
    } else {
      ReportSeveral(results);
    }
  }

 private:
  fs::path Folder() const { return split_.empty() ? fs::path(root_) : fs::path(root_) / split_; }

  std::unique_ptr<Dataset> OpenDataset() {
    const fs::path folder = Folder();
    protocol_.seed = common_.seed;
    protocol_.in_plane_rotation_deg = rotated_ ? kRotatedDeg : 0;
    if (dataset_ == "objects") return std::make_unique<ObjectDataset>(folder, protocol_);
    if (dataset_ == "photos") return std::make_unique<PhotoDataset>(folder);
    throw InvalidOption("--dataset", Quoted(dataset_) + " is unknown", "use objects or photos");
  }

  std::vector<EvaluationResult> Evaluate(const Dataset& dataset, const std::vector<PoseMethod>& methods) const {
    ProgressLine line(common_.ProgressMode());
    EvaluationOptions options = options_;
    options.seed = common_.seed;
    return antipode::Evaluate(dataset, methods, options, [&](const Progress& progress) {
      ThrowIfInterrupted();
      line.Show(progress);
    });
  }

  void ReportOrientation(const Dataset& dataset) const {
    if (dataset_ != "objects") throw InvalidOption("--orientation", "needs the true vertical axis", "use it with --dataset objects");
    ProgressLine line(common_.ProgressMode());
    const auto report = [&](const Progress& progress) {
      ThrowIfInterrupted();
      line.Show(progress);
    };
    const ReferenceModels models = ReferenceModels::Load(method_.model, common_.device);
    const auto matcher = MakeMatcher(method_.MatcherFor("matching"), SelectDevice(common_.device));
    nlohmann::ordered_json json;
    const auto add = [&](const char* name, const OrientationErrors& errors) {
      json[name] = {{"views", errors.elevation.size()}, {"failures", errors.failures},
                    {"median_elevation_error_deg", Median(errors.elevation)}, {"median_in_plane_error_deg", Median(errors.in_plane)}};
      if (common_.PrintsText())
        std::cout << Formatted("%-7s %4zu views  median error: elevation %5.1f  in-plane rotation %5.1f degrees  failures %d\n", name,
                               errors.elevation.size(), Median(errors.elevation), Median(errors.in_plane), errors.failures);
    };
    if (models.upright) add("code", MeasureUprightEstimator(dataset, *orientation_views_, *models.prior, *models.upright, report));
    OrientationSearchOptions search;
    if (!rotated_) search.in_plane_rotations_deg = {0};
    add("search", MeasureOrientationSearch(dataset, *orientation_views_, Folder(), *matcher, search, report));
    common_.WriteJson({{"orientation", json}});
  }

  void ReportFalseConfidence(const Dataset& dataset, const std::vector<PoseMethod>& methods) const {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const PoseMethod& method : methods) {
      const FalseConfidence result = FalseConfidenceOf(dataset, method);
      const double share = result.ShareAbove(kSure);
      list.push_back({{"method", method.name},
                      {"pairs", result.confidences.size()},
                      {"failures", result.failures},
                      {"percent_above_half", share},
                      {"confidences", result.confidences}});
      if (common_.PrintsText()) {
        std::cout << Formatted("%s: %zu pairs of different objects, confidence above %.1f in %.1f %% of them\n",
                               method.name.c_str(), result.confidences.size(), kSure, share);
      }
    }
    common_.WriteJson({{"different_objects", list}});
  }

  FalseConfidence FalseConfidenceOf(const Dataset& dataset, const PoseMethod& method) const {
    ProgressLine line(common_.ProgressMode());
    return MeasureFalseConfidence(dataset, method, {.pairs = *different_objects_, .seed = common_.seed},
                                  [&](const Progress& progress) {
                                    ThrowIfInterrupted();
                                    line.Show(progress);
                                  });
  }

  void ReportOne(const EvaluationResult& result) const {
    if (!out_.empty()) WriteEvaluation(result, out_);
    const EvaluationSummary summary = Summarize(result);
    common_.WriteJson(nlohmann::ordered_json::parse(SummaryJson(summary)));
    if (!common_.PrintsText()) return;
    std::cout << SummaryTable(summary);
    PrintWhereItIs("pairs.csv, summary.json and table.md in " + out_);
  }

  void ReportSeveral(const std::vector<EvaluationResult>& results) const {
    std::vector<EvaluationSummary> summaries;
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const EvaluationResult& result : results) {
      if (!out_.empty()) WriteEvaluation(result, fs::path(out_) / FolderName(result.method));
      summaries.push_back(Summarize(result));
      json.push_back(nlohmann::ordered_json::parse(SummaryJson(summaries.back())));
    }
    const std::string table = ComparisonTable(summaries);
    if (!out_.empty()) WriteFileAtomically(fs::path(out_) / "table.md", table);
    common_.WriteJson({{"methods", json}});
    if (!common_.PrintsText()) return;
    std::cout << table;
    PrintWhereItIs("table.md and a folder for each method in " + out_);
  }

  /// Anything but letters, digits, '.', '+' and '-' could mean something to a file system.
  static std::string FolderName(std::string method) {
    for (char& c : method)
      if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '+' && c != '-') c = '_';
    return method;
  }

  void PrintWhereItIs(const std::string& files) const {
    if (out_.empty()) {
      std::cout << "\nNext: --out DIR keeps every pair, the summary and this table.\n";
    } else {
      std::cout << "\nWritten: " << files << "\n";
    }
  }

  std::string dataset_, root_, split_, out_;
  MethodRequest method_;
  std::optional<int> different_objects_;
  std::optional<std::size_t> orientation_views_;
  std::optional<std::string> sweep_;
  bool rotated_ = false;
  double dilation_percent_ = 0;
  std::optional<std::string> degradation_;
  ObjectProtocolOptions protocol_;
  EvaluationOptions options_;
  CommonOptions common_;
};

}  // namespace

std::unique_ptr<Command> MakeEvaluateCommand() { return std::make_unique<EvaluateCommand>(); }

}  // namespace antipode
