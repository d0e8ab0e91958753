#include <algorithm>
#include <iostream>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/progress_line.h"
#include "antipode/evaluation/dataset.h"
#include "antipode/evaluation/evaluation.h"
#include "antipode/evaluation/evaluation_files.h"
#include "antipode/evaluation/evaluation_summary.h"
#include "antipode/nn/device.h"
#include "antipode/util/error.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr double kRotatedDeg = 45;

class EvaluateCommand : public Command {
 public:
  std::string Name() const override { return "evaluate"; }
  std::string Summary() const override { return "Accuracy on objects or photographs with known poses"; }
  std::string Example() const override {
    return "  antipode evaluate --dataset objects --root meshes --split test --out results\n"
           "  antipode evaluate --dataset photos --root photos --out results";
  }

  void DeclareOptions(CLI::App& app) override {
    app.add_option("--dataset", dataset_, "objects: meshes, rendered; photos: pictures with a cameras.json")
        ->required()->type_name("objects|photos");
    app.add_option("--root", root_, "Folder of the data set")->required()->type_name("DIR");
    app.add_option("--split", split_, "Use this folder in the root, for example test")->type_name("NAME");
    app.add_option("--method", method_, "prior: the built-in equivariant object prior")->capture_default_str()
        ->type_name("NAME");
    app.add_option("--model", model_, "Name of a model (see 'antipode models list') or its folder")
        ->capture_default_str()->type_name("NAME|FOLDER");
    app.add_option("--out", out_, "Folder for pairs.csv, summary.json and table.md")->type_name("DIR");
    app.add_option("--views", protocol_.views, "Views of each object: one reference, the others are queries")
        ->capture_default_str()->type_name("N")->group("Data set objects");
    app.add_option("--image-size", protocol_.image_size, "Side of the pictures, pixels")->capture_default_str()
        ->type_name("N")->group("Data set objects");
    app.add_flag("--rotated", rotated_, "Roll every camera by -45 to 45 degrees")->group("Data set objects");
    app.add_flag("--check-swap", options_.check_swap, "Also estimate every pair the other way round");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    if (method_ != "prior") throw InvalidOption("--method", Quoted(method_) + " is unknown", "use prior");
    const std::unique_ptr<Dataset> dataset = OpenDataset();
    const ObjectPrior prior = ObjectPrior::Load(model_, SelectDevice(common_.device));
    const EvaluationResult result = Evaluate(*dataset, prior);
    if (!out_.empty()) WriteEvaluation(result, out_);
    const EvaluationSummary summary = Summarize(result);
    common_.WriteJson(nlohmann::ordered_json::parse(SummaryJson(summary)));
    if (!common_.PrintsText()) return;
    std::cout << SummaryTable(summary);
    if (out_.empty()) {
      std::cout << "\nNext: --out DIR keeps every pair, the summary and this table.\n";
    } else {
      std::cout << "\nWritten: pairs.csv, summary.json and table.md in " << out_ << "\n";
    }
  }

 private:
  std::unique_ptr<Dataset> OpenDataset() {
    const fs::path folder = split_.empty() ? fs::path(root_) : fs::path(root_) / split_;
    protocol_.seed = common_.seed;
    protocol_.in_plane_rotation_deg = rotated_ ? kRotatedDeg : 0;
    if (dataset_ == "objects") return std::make_unique<ObjectDataset>(folder, protocol_);
    if (dataset_ == "photos") return std::make_unique<PhotoDataset>(folder);
    throw InvalidOption("--dataset", Quoted(dataset_) + " is unknown", "use objects or photos");
  }

  EvaluationResult Evaluate(const Dataset& dataset, const ObjectPrior& prior) const {
    const PoseMethod method{
        method_, [&](const ObjectPhotograph& reference, const ObjectPhotograph& query) {
          return EstimatePose(prior, reference, query);
        }};
    ProgressLine line(common_.ProgressMode());
    return antipode::Evaluate(dataset, method, options_, [&](const Progress& progress) {
      ThrowIfInterrupted();
      line.Show(progress);
    });
  }

  std::string dataset_, root_, split_, out_;
  std::string method_ = "prior";
  std::string model_ = "prior";
  bool rotated_ = false;
  ObjectProtocolOptions protocol_;
  EvaluationOptions options_;
  CommonOptions common_;
};

}  // namespace

std::unique_ptr<Command> MakeEvaluateCommand() { return std::make_unique<EvaluateCommand>(); }

}  // namespace antipode
