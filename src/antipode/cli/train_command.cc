#include <iostream>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/progress_line.h"
#include "antipode/render/mesh_collection.h"
#include "antipode/render/mesh_pack.h"
#include "antipode/training/matcher_trainer.h"
#include "antipode/training/prior_trainer.h"
#include "antipode/training/ranker_trainer.h"
#include "antipode/training/upright_trainer.h"
#include "antipode/training/view_comparison_trainer.h"
#include "antipode/training/views_trainer.h"
#include "antipode/training/volume_trainer.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

void DeclareObjects(CLI::App& app, std::filesystem::path& objects,
                    const char* description = "Folder of .glb files to train on, or a pack of them (train pack)") {
  app.add_option("--objects", objects, description)->required()->type_name("DIR|PACK");
}

/// What a trainer renders before it starts.
void DeclareCache(CLI::App& app, std::filesystem::path& folder, ViewCacheOptions& views) {
  app.add_option("--cache", folder, "Folder for the rendered views; without: OUT/cache")->type_name("DIR");
  app.add_option("--cached-views", views.views_per_object, "Views rendered of each variant of an object")->capture_default_str()->type_name("N");
  app.add_option("--variants", views.variants, "Variants of an object: itself, then in turn stretched, retextured, joined with another")
      ->capture_default_str()->type_name("N");
}

/// What all trainers that can be resumed take.
void DeclareRun(CLI::App& app, TrainingRunOptions& run, const std::string& model) {
  app.add_option("--out", run.out, "Folder for checkpoint.safetensors, log.csv and the model " + model + "/")->required()->type_name("DIR");
  app.add_option("--minutes", run.minutes, "Time budget, all resumed runs together")->capture_default_str()->type_name("N");
  app.add_option("--iterations", run.iterations, "Or a number of steps, which makes runs reproducible")->type_name("N");
  app.add_flag("--resume", run.resume, "Go on from OUT/checkpoint.safetensors");
  app.add_option("--learning-rate", run.learning_rate, "Highest")->capture_default_str()->type_name("X");
}

template <typename Result>
void WriteJson(const CommonOptions& common, const Result& result) {
  common.WriteJson({{"model", result.model.string()}, {"steps", result.steps}, {"first_loss", result.first_loss}, {"loss", result.last_loss}});
}

[[noreturn]] void ThrowStopped(std::int64_t steps) {
  throw Interrupted("training", Formatted("stopped on request after %lld steps; all is saved", static_cast<long long>(steps)),
                    "go on with the same command and --resume");
}

class TrainPriorCommand : public Command {
 public:
  std::string Name() const override { return "prior"; }
  std::string Summary() const override { return "The object prior, from a folder of meshes"; }
  std::string Example() const override {
    return "  antipode train prior --objects meshes/train --validation meshes/val --out my_prior --minutes 60\n"
           "Ctrl-C saves and stops; go on with the same command and --resume.";
  }

  void DeclareOptions(CLI::App& app) override {
    DeclareObjects(app, options_.objects);
    app.add_option("--out", options_.out, "Folder for checkpoint.safetensors, log.csv and the model prior/")
        ->required()->type_name("DIR");
    app.add_option("--validation", options_.validation_objects, "Folder or pack of .glb files to measure on")
        ->type_name("DIR|PACK");
    DeclareCache(app, options_.cache, options_.views);
    app.add_option("--minutes", options_.minutes, "Time budget, all resumed runs together")
        ->capture_default_str()->type_name("N");
    app.add_option("--iterations", options_.iterations, "Or a number of steps, which makes runs reproducible")
        ->type_name("N");
    auto* resume = app.add_flag("--resume", resume_, "Go on from OUT/checkpoint.safetensors");
    auto* start = app.add_option("--start", options_.start, "Model that training starts from: an ImageNet backbone, or a prior")
                      ->capture_default_str()->type_name("NAME|FOLDER");
    app.add_flag("--from-scratch", from_scratch_, "Start from random weights instead")->excludes(resume)->excludes(start);
    app.add_option("--learning-rate", options_.learning_rate, "Highest, of all but the backbone")
        ->capture_default_str()->type_name("X");
    app.add_option("--backbone-learning-rate", options_.backbone_learning_rate, "Highest, of the backbone")
        ->capture_default_str()->type_name("X");
    app.add_option("--objects-per-step", options_.objects_per_step, "Objects in a batch")
        ->capture_default_str()->type_name("N");
    app.add_option("--views-per-object", options_.views_per_object, "Views of each object in a batch")
        ->capture_default_str()->type_name("N");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    options_.seed = common_.seed;
    options_.device = common_.device;
    options_.threads = common_.threads;
    options_.Check();
    Report(Train());
  }

 private:
  StartFrom Start() const {
    if (resume_) return StartFrom::kCheckpoint;
    return from_scratch_ ? StartFrom::kScratch : StartFrom::kModel;
  }

  PriorTrainingResult Train() const {
    ProgressLine line(common_.ProgressMode());
    return TrainPrior(options_, Start(), [&](const Progress& progress) {
      // Once it trains, the trainer saves a checkpoint before it stops by itself.
      if (progress.stage.starts_with("rendering")) ThrowIfInterrupted();
      line.Show(progress);
    });
  }

  void Report(const PriorTrainingResult& result) const {
    common_.WriteJson({{"model", result.model.string()},
                       {"steps", result.steps},
                       {"minutes", result.minutes},
                       {"loss", result.loss},
                       {"interrupted", result.interrupted}});
    if (result.interrupted) ThrowStopped(result.steps);
    if (!common_.PrintsText()) return;
    std::cout << Formatted("%lld steps in %.1f minutes, loss %.3f\n", static_cast<long long>(result.steps),
                           result.minutes, result.loss)
              << "Model: " << result.model.string() << "\n"
              << "Next: antipode pose REFERENCE QUERY --model " << result.model.string() << "\n";
  }

  PriorTrainingOptions options_;
  bool resume_ = false;
  bool from_scratch_ = false;
  CommonOptions common_;
};

class TrainRankerCommand : public Command {
 public:
  std::string Name() const override { return "ranker"; }
  std::string Summary() const override { return "A prior's second stage, which weighs its hypotheses anew"; }
  std::string Example() const override {
    return "  antipode train ranker --objects meshes/train --validation meshes/val --model my_prior/prior --out my_ranked_prior\n"
           "Ctrl-C saves and stops; go on with the same command and --resume.";
  }

  void DeclareOptions(CLI::App& app) override {
    DeclareObjects(app, options_.objects);
    DeclareRun(app, options_.run, "prior");
    app.add_option("--validation", options_.validation_objects, "Folder or pack of .glb files to calibrate on; without: as it was")->type_name("DIR|PACK");
    app.add_option("--model", options_.prior, "The first stage: name of a model or its folder")->capture_default_str()->type_name("NAME|FOLDER");
    DeclareCache(app, options_.cache, options_.views);
    app.add_option("--groups", options_.groups, "Groups of views of one object that are encoded")->capture_default_str()->type_name("N");
    app.add_option("--batch", options_.batch, "Pairs a step")->capture_default_str()->type_name("N");
    app.add_option("--points", options_.ranker.points, "Of the sphere, where the codes are compared")->capture_default_str()->type_name("N");
    app.add_option("--width", options_.ranker.width, "What is kept of a code at a point")->capture_default_str()->type_name("N");
    app.add_option("--hidden", options_.ranker.hidden, "Width of the layers that compare")->capture_default_str()->type_name("N");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    options_.run.seed = common_.seed;
    options_.threads = common_.threads;
    ProgressLine line(common_.ProgressMode());
    const RankerTrainingResult result = TrainRanker(options_, [&](const Progress& progress) {
      if (progress.stage != "training") ThrowIfInterrupted();
      line.Show(progress);
    });
    WriteJson(common_, result);
    if (result.interrupted) ThrowStopped(result.steps);
    if (!common_.PrintsText()) return;
    std::cout << Formatted("%lld steps, loss %.4f at first, %.4f at last; the best hypothesis chosen in %.0f %% of pairs\n",
                           static_cast<long long>(result.steps), result.first_loss, result.last_loss, 100 * result.share_right)
              << "Model: " << result.model.string() << "\n"
              << "Next: antipode pose REFERENCE QUERY --model " << result.model.string() << "\n";
  }

 private:
  RankerTrainingOptions options_;
  CommonOptions common_;
};

class TrainUprightCommand : public Command {
 public:
  std::string Name() const override { return "upright"; }
  std::string Summary() const override { return "Which way is up, from the codes of a trained prior"; }
  std::string Example() const override {
    return "  antipode train upright --objects meshes/train --model my_prior/prior --out my_upright";
  }

  void DeclareOptions(CLI::App& app) override {
    DeclareObjects(app, options_.objects, "Folder of .glb files that stand upright, +Y up, or a pack of them (train pack)");
    app.add_option("--out", options_.out, "Folder for the model upright/")->required()->type_name("DIR");
    DeclareCache(app, options_.cache, options_.views);
    app.add_option("--model", prior_, "The prior: name of a model or its folder")->capture_default_str()->type_name("NAME|FOLDER");
    app.add_option("--steps", options_.steps, "Of the optimiser")->capture_default_str()->type_name("N");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    options_.seed = common_.seed;
    const ObjectPrior prior = ObjectPrior::Load(prior_);
    ProgressLine line(common_.ProgressMode());
    const UprightTrainingResult result = TrainUpright(options_, prior, FindModel(prior_).sha256, [&](const Progress& progress) {
      ThrowIfInterrupted();
      line.Show(progress);
    });
    common_.WriteJson({{"model", result.model.string()}, {"loss", result.loss}});
    if (common_.PrintsText()) std::cout << Formatted("loss %.4f\n", result.loss) << "Model: " << result.model.string() << "\n";
  }

 private:
  UprightTrainingOptions options_;
  std::string prior_ = "prior";
  CommonOptions common_;
};

class TrainViewsCommand : public Command {
 public:
  std::string Name() const override { return "views"; }
  std::string Summary() const override { return "A small diffusion model that imagines views"; }
  std::string Example() const override {
    return "  antipode train views --objects meshes/train --out my_views --minutes 60\n"
           "  antipode synthesize photo.png --model my_views/views --views 16 --out views\n"
           "Ctrl-C saves and stops; go on with the same command and --resume.";
  }

  void DeclareOptions(CLI::App& app) override {
    DeclareObjects(app, options_.objects);
    DeclareRun(app, options_.run, "views");
    DeclareCache(app, options_.cache, options_.views);
    app.add_option("--objects-per-step", options_.objects_per_step, "Objects in a batch")->capture_default_str()->type_name("N");
    app.add_option("--views-per-object", options_.views_per_object, "Views of each object in a batch")->capture_default_str()->type_name("N");
    app.add_option("--image-size", image_size_, "Side of the pictures, pixels")->capture_default_str()->type_name("N");
    app.add_option("--width", width_, "Half the channels at full resolution, a multiple of 32")->capture_default_str()->type_name("N");
    app.add_option("--cell", cell_, "Side of the squares of pixels that the network sees as one: 4 learns faster than 2, in less detail")
        ->capture_default_str()->type_name("N");
    app.add_option("--prior", options_.prior, "Whose codes of the picture guide the views, or none")->capture_default_str()->type_name("NAME|FOLDER");
    app.add_option("--predict", predict_, "velocity or noise")->capture_default_str()->type_name("NAME");
    app.add_option("--pose", pose_, "rotation: the relative rotation; zero123: its four numbers")->capture_default_str()->type_name("NAME");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    options_.run.seed = common_.seed;
    options_.device = common_.device;
    if (options_.prior == "none") options_.prior.clear();
    ViewDiffusionConfig config = ViewDiffusionConfig::Small(width_, cell_);
    config.image_size = image_size_;
    config.target = Choose(predict_, "--predict", "velocity", DiffusionTarget::kVelocity, "noise", DiffusionTarget::kNoise);
    config.pose = Choose(pose_, "--pose", "rotation", PoseCondition::kRelativeRotation, "zero123", PoseCondition::kZero123);
    ProgressLine line(common_.ProgressMode());
    const TrainingResult result = TrainViews(options_, config, [&](const Progress& progress) {
      if (progress.stage.starts_with("rendering")) ThrowIfInterrupted();
      line.Show(progress);
    });
    WriteJson(common_, result);
    if (result.interrupted) ThrowStopped(result.steps);
    if (common_.PrintsText())
      std::cout << Formatted("%lld steps, loss %.4f\n", static_cast<long long>(result.steps), result.last_loss) << "Model: "
                << result.model.string() << "\n";
  }

 private:
  template <typename Value>
  static Value Choose(const std::string& name, const char* option, const char* first, Value first_value, const char* second, Value second_value) {
    if (name == first) return first_value;
    if (name == second) return second_value;
    throw InvalidOption(option, "is " + name, std::string("use ") + first + " or " + second);
  }

  ViewsTrainingOptions options_;
  std::int64_t width_ = 32;
  int image_size_ = 64, cell_ = 2;
  std::string predict_ = "velocity", pose_ = "rotation";
  CommonOptions common_;
};

class TrainVolumeCommand : public Command {
 public:
  std::string Name() const override { return "volume"; }
  std::string Summary() const override { return "A coarse volume of the object in a picture, which shows it from other viewpoints"; }
  std::string Example() const override {
    return "  antipode train volume --objects meshes/train --validation meshes/val --out my_volume --minutes 60\n"
           "  antipode synthesize photo.png --model my_volume/volume --views 16 --out views\n"
           "Ctrl-C saves and stops; go on with the same command and --resume.";
  }

  void DeclareOptions(CLI::App& app) override {
    DeclareObjects(app, options_.objects);
    DeclareRun(app, options_.run, "volume");
    app.add_option("--validation", options_.validation_objects, "Folder or pack of .glb files to measure on")->type_name("DIR|PACK");
    DeclareCache(app, options_.cache, options_.views);
    app.add_option("--objects-per-step", options_.objects_per_step, "Objects in a batch")->capture_default_str()->type_name("N");
    app.add_option("--views-per-object", options_.views_per_object, "Views of each object in a batch, the picture among them")
        ->capture_default_str()->type_name("N");
    app.add_option("--prior", options_.prior, "Whose backbone it sees with")->capture_default_str()->type_name("NAME|FOLDER");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    options_.run.seed = common_.seed;
    options_.device = common_.device;
    options_.threads = common_.threads;
    ProgressLine line(common_.ProgressMode());
    const VolumeTrainingResult result = TrainVolume(options_, {}, [&](const Progress& progress) {
      if (progress.stage.starts_with("rendering")) ThrowIfInterrupted();
      line.Show(progress);
    });
    common_.WriteJson({{"model", result.model.string()}, {"steps", result.steps}, {"first_loss", result.first_loss}, {"loss", result.last_loss},
                       {"validation_db", result.validation_db}, {"picture_db", result.picture_db}});
    if (result.interrupted) ThrowStopped(result.steps);
    if (!common_.PrintsText()) return;
    std::cout << Formatted("%lld steps, loss %.4f\n", static_cast<long long>(result.steps), result.last_loss);
    if (result.validation_db > 0)
      std::cout << Formatted("Validation: views %.2f dB to the rendering, the picture itself %.2f dB\n", result.validation_db, result.picture_db);
    std::cout << "Model: " << result.model.string() << "\n";
  }

 private:
  VolumeTrainingOptions options_;
  CommonOptions common_;
};

class TrainMatcherCommand : public Command {
 public:
  std::string Name() const override { return "matcher"; }
  std::string Summary() const override { return "LighterGlue, on views of objects from far apart"; }
  std::string Example() const override {
    return "  antipode train matcher --objects meshes/train --out my_matcher --minutes 90\n"
           "  antipode pose front.jpg back.jpg --matcher my_matcher/object-lighterglue\n"
           "Ctrl-C saves and stops; go on with the same command and --resume.";
  }

  void DeclareOptions(CLI::App& app) override {
    DeclareObjects(app, options_.objects);
    DeclareRun(app, options_.run, "object-lighterglue");
    app.add_option("--start", options_.start, "Model that training starts from")->capture_default_str()->type_name("NAME|FOLDER");
    app.add_option("--points", options_.points, "Features of a picture in every pair")->capture_default_str()->type_name("N");
    app.add_option("--variants", options_.variants, "Variants of an object: itself, then in turn stretched, retextured, joined with another")
        ->capture_default_str()->type_name("N");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    options_.run.seed = common_.seed;
    ProgressLine line(common_.ProgressMode());
    const TrainingResult result = TrainMatcher(options_, [&](const Progress& progress) { line.Show(progress); });
    WriteJson(common_, result);
    if (result.interrupted) ThrowStopped(result.steps);
    if (common_.PrintsText())
      std::cout << Formatted("%lld steps, loss %.4f at first, %.4f at last\n", static_cast<long long>(result.steps), result.first_loss,
                             result.last_loss)
                << "Model: " << result.model.string() << "\n";
  }

 private:
  MatcherTrainingOptions options_;
  CommonOptions common_;
};

/// The selector or the refiner.
class TrainViewComparisonCommand : public Command {
 public:
  enum class Network { kSelector, kRefiner };
  explicit TrainViewComparisonCommand(Network network) : network_(network) {}

  std::string Name() const override { return network_ == Network::kSelector ? "selector" : "refiner"; }
  std::string Summary() const override {
    return network_ == Network::kSelector ? "Gen6D's viewpoint selector, on rendered objects" : "Gen6D's pose refiner, on rendered objects";
  }
  std::string Example() const override {
    return "  antipode train " + Name() + " --objects meshes/train --out my_" + Name() + " --minutes 60\n" +
           "  antipode pose front.jpg back.jpg --mesh object.glb --" + Name() + " my_" + Name() + "/" + Name() + "\n" +
           "Ctrl-C saves and stops; go on with the same command and --resume.";
  }

  void DeclareOptions(CLI::App& app) override {
    DeclareObjects(app, options_.objects);
    DeclareRun(app, options_.run, Name());
    app.add_option("--backbone", backbone_, "efficientnet-lite0: small, shares that of the prior; vgg11-bn: the published size")
        ->capture_default_str()->type_name("NAME");
    app.add_option("--backbone-model", options_.backbone_model, "Whose backbone it is: a prior, or an imported selector for vgg11-bn")
        ->capture_default_str()->type_name("NAME|FOLDER");
    app.add_option("--batch", options_.batch, "Queries a step")->capture_default_str()->type_name("N");
    app.add_option("--most-objects", options_.rendering.most_objects, "Use so many objects; 0: all")->capture_default_str()->type_name("N");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    options_.run.seed = common_.seed;
    const ViewComparisonTrainingResult result = Train();
    WriteJson(common_, result);
    if (result.interrupted) ThrowStopped(result.steps);
    if (!common_.PrintsText()) return;
    std::cout << Formatted("%lld steps, loss %.4f at first, %.4f at last; %.4f for a network that says nothing\n",
                           static_cast<long long>(result.steps), result.first_loss, result.last_loss, result.uninformed_loss)
              << "Model: " << result.model.string() << "\n";
  }

 private:
  ViewComparisonTrainingResult Train() const {
    ProgressLine line(common_.ProgressMode());
    const auto report = [&](const Progress& progress) {
      if (progress.stage.starts_with("rendering")) ThrowIfInterrupted();
      line.Show(progress);
    };
    const bool is_small = BackboneKindOf(backbone_) == BackboneKind::kEfficientNetLite0;
    if (network_ == Network::kSelector) return TrainSelector(options_, is_small ? BuiltInSelector() : SelectorConfig(), report);
    return TrainRefiner(options_, is_small ? BuiltInRefiner() : RefinerConfig(), report);
  }

  Network network_;
  std::string backbone_ = "efficientnet-lite0";
  ViewComparisonTrainingOptions options_;
  CommonOptions common_;
};

class TrainPackCommand : public Command {
 public:
  std::string Name() const override { return "pack"; }
  std::string Summary() const override { return "One small file of all meshes, to train on another machine"; }
  std::string Example() const override {
    return "  antipode train pack --objects meshes/train --out train.pack --megabytes 28\n"
           "  antipode train prior --objects train.pack --out my_prior";
  }

  void DeclareOptions(CLI::App& app) override {
    app.add_option("--objects", objects_, "Folder of .glb files")->required()->type_name("DIR");
    app.add_option("--out", out_, "The pack")->required()->type_name("FILE");
    app.add_option("--megabytes", options_.megabytes, "Its greatest size, MiB; textures are reduced until it fits")
        ->capture_default_str()->type_name("N");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    const MeshPackResult result = Pack();
    common_.WriteJson({{"pack", out_.string()},
                       {"objects", result.objects},
                       {"triangles", result.triangles},
                       {"bytes", result.bytes},
                       {"textures", result.textures},
                       {"texture_side", result.texture_side},
                       {"greatest_position_error_radii", result.greatest_position_error}});
    if (common_.PrintsText()) Print(result);
  }

 private:
  MeshPackResult Pack() const {
    ProgressLine line(common_.ProgressMode());
    return PackMeshes(MeshCollection::Open(objects_), out_, options_, [&](const Progress& progress) {
      ThrowIfInterrupted();
      line.Show(progress);
    });
  }

  void Print(const MeshPackResult& result) const {
    std::cout << Formatted("%lld objects, %lld triangles in %.2f MiB\n", static_cast<long long>(result.objects),
                           static_cast<long long>(result.triangles), static_cast<double>(result.bytes) / 0x1p20)
              << Formatted("%lld textures of at most %d pixels a side\n", static_cast<long long>(result.textures), result.texture_side)
              << Formatted("Greatest error of a position: %.1e object radii\n", result.greatest_position_error) << "Pack: "
              << out_.string() << "\n"
              << "Next: antipode train prior --objects " << out_.string() << " --out my_prior\n";
  }

  std::filesystem::path objects_, out_;
  MeshPackOptions options_;
  CommonOptions common_;
};

class TrainCommand : public Command {
 public:
  std::string Name() const override { return "train"; }
  std::string Summary() const override { return "Train a model"; }
  std::string Example() const override {
    return "  antipode train prior --objects meshes/train --out my_prior --minutes 60\n"
           "  antipode train pack --objects meshes/train --out train.pack";
  }
  void DeclareOptions(CLI::App&) override {}
  void Run() override {}
  std::vector<std::unique_ptr<Command>> Subcommands() const override {
    std::vector<std::unique_ptr<Command>> commands;
    commands.push_back(std::make_unique<TrainPriorCommand>());
    commands.push_back(std::make_unique<TrainRankerCommand>());
    commands.push_back(std::make_unique<TrainUprightCommand>());
    commands.push_back(std::make_unique<TrainViewsCommand>());
    commands.push_back(std::make_unique<TrainVolumeCommand>());
    commands.push_back(std::make_unique<TrainMatcherCommand>());
    for (const auto network : {TrainViewComparisonCommand::Network::kSelector, TrainViewComparisonCommand::Network::kRefiner})
      commands.push_back(std::make_unique<TrainViewComparisonCommand>(network));
    commands.push_back(std::make_unique<TrainPackCommand>());
    return commands;
  }
};

}  // namespace

std::unique_ptr<Command> MakeTrainCommand() { return std::make_unique<TrainCommand>(); }

}  // namespace antipode
