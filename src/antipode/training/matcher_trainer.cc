#include "antipode/training/matcher_trainer.h"

#include <deque>
#include <fstream>
#include <future>
#include <memory>
#include <utility>

#include "antipode/matching/light_glue.h"
#include "antipode/matching/xfeat_matcher.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/nn/precision.h"
#include "antipode/render/mesh_collection.h"
#include "antipode/training/learning_rate.h"
#include "antipode/training/loss_average.h"
#include "antipode/training/mesh_variants.h"
#include "antipode/training/training_state.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/seeds.h"
#include "antipode/util/stopwatch.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using torch::Tensor;
namespace fs = std::filesystem;

constexpr char kCheckpoint[] = "checkpoint.safetensors";
constexpr int kStepsOfAverage = 50;
constexpr int kWarmUpSteps = 50;
constexpr int kStepsAhead = 2;
constexpr std::int64_t kLeastFeatures = 64;
constexpr double kWeightOfEarlierLayers = 0.1;

/// Renders the pairs of coming steps in the background.
class PairLoader {
 public:
  PairLoader(const MatcherTrainingOptions& options, const TensorFile& weights)
      : options_(options), meshes_(MeshCollection::Open(options.objects)),
        features_(WithoutPrefix(weights, kXFeatPrefix), options.start, {.top_k = options.features}) {}

  std::vector<SurfacePair> Get(std::int64_t step) {
    for (std::int64_t next = step + static_cast<std::int64_t>(ahead_.size()); next <= step + kStepsAhead; ++next)
      ahead_.push_back(std::async(std::launch::async, [this, next] { return Make(next); }));
    std::vector<SurfacePair> pairs = ahead_.front().get();
    ahead_.pop_front();
    return pairs;
  }

 private:
  std::vector<SurfacePair> Make(std::int64_t step) const {
    std::mt19937_64 random(CombineSeeds(options_.seed, static_cast<std::uint64_t>(step)));
    Mesh mesh = meshes_.Load(UniformIndex(random, meshes_.size()));
    mesh.Normalize();
    const std::size_t donor = UniformIndex(random, meshes_.size());
    const int kind = static_cast<int>(UniformIndex(random, static_cast<std::size_t>(options_.variants)));
    const auto load_donor = [&] { return meshes_.Load(donor); };
    return RenderMatchingPairs(features_, RandomVariant(kind, mesh, load_donor, options_.stretch, random), options_.pairs, random);
  }

  const MatcherTrainingOptions& options_;
  MeshCollection meshes_;
  XFeat features_;
  std::deque<std::future<std::vector<SurfacePair>>> ahead_;
};

/// Half of the points, if there are so many, have a match.
Tensor DrawPoints(const Tensor& matched, std::int64_t features, std::int64_t count) {
  const Tensor first = matched.slice(0, 0, count / 2), all = torch::randperm(features, torch::kLong);
  const Tensor is_drawn = torch::zeros({features}, torch::kBool).index_fill_(0, first, true);
  const Tensor others = all.masked_select(is_drawn.index_select(0, all).logical_not());
  return at::cat({first, others.slice(0, 0, count - first.size(0))});
}

SurfacePair Thinned(const SurfacePair& pair, std::int64_t count) {
  const TrueMatches truth = MatchSurfaces(pair.reference, pair.query);
  const Tensor order = torch::randperm(truth.reference.size(0), torch::kLong);
  const auto draw = [&](const SurfaceFeatures& features, const Tensor& matched) {
    return features.Select(DrawPoints(matched.index_select(0, order), features.features.size(), count));
  };
  return {draw(pair.reference, truth.reference), draw(pair.query, truth.query)};
}

/// Mean of -log(1 - probability of a match) over the lonely features; 0 if there are none.
Tensor LossOfLonely(const Tensor& matchability, const Tensor& is_lonely) {
  const Tensor weights = is_lonely.to(torch::kFloat);
  return (torch::softplus(matchability) * weights).sum() / weights.sum().clamp_min(1);
}

Tensor LossOfLayer(const LightGlueAssignment& said, const TrueMatches& truth) {
  Tensor loss = 0.5 * (LossOfLonely(said.reference_matchability, truth.reference_is_lonely) +
                       LossOfLonely(said.query_matchability, truth.query_is_lonely));
  if (truth.reference.size(0) > 0) loss = loss - said.log_probability.index({truth.reference, truth.query}).mean();
  return loss;
}

class Trainer {
 public:
  Trainer(const MatcherTrainingOptions& options, const ProgressCallback& progress)
      : options_(options), progress_(progress), weights_(LoadModel(options.start)), loader_(options, weights_),
        network_(LightGlueConfig::LighterGlue()) {
    LoadInto(*network_, WithoutPrefix(weights_, kLighterGluePrefix), options.start);
    average_ = StartAverage(*network_);
    optimizer_ = std::make_unique<torch::optim::AdamW>(network_->parameters(), torch::optim::AdamWOptions(options.learning_rate).weight_decay(0));
    if (options.resume) Resume();
  }

  MatcherTrainingResult Run() {
    stopwatch_ = {};
    std::ofstream log(options_.out / "log.csv", options_.resume ? std::ios::app : std::ios::trunc);
    if (!options_.resume) log << "step,minutes,loss\n";
    MatcherTrainingResult result;
    while (Fraction() < 1 && !result.interrupted) {
      Step();
      if (step_ % 20 == 0) log << step_ << ',' << Minutes() << ',' << losses_.last() << std::endl;
      if (progress_) progress_({"training", static_cast<std::int64_t>(1000 * Fraction()), 1000, Formatted("loss %.3f", losses_.last())});
      result.interrupted = InterruptRequested();
    }
    SaveCheckpoint();
    result.steps = step_;
    result.first_loss = losses_.first();
    result.last_loss = losses_.last();
    result.model = SaveAverage();
    return result;
  }

 private:
  double Minutes() const { return minutes_before_ + stopwatch_.Seconds() / 60; }
  double Fraction() const {
    return options_.iterations > 0 ? static_cast<double>(step_) / options_.iterations : Minutes() / options_.minutes;
  }

  void Step() {
    torch::manual_seed(CombineSeeds(options_.seed + 1, static_cast<std::uint64_t>(step_)));
    const std::vector<SurfacePair> pairs = loader_.Get(step_);
    SetLearningRate(*optimizer_, options_.learning_rate * LearningRateFactor(step_, kWarmUpSteps, Fraction()));
    optimizer_->zero_grad();
    double sum = 0;
    int used = 0;
    for (const SurfacePair& pair : pairs) {
      if (std::min(pair.reference.features.size(), pair.query.features.size()) < kLeastFeatures) continue;
      const Tensor loss = LossOf(Thinned(pair, options_.points));
      (loss / static_cast<double>(pairs.size())).backward();
      sum += loss.item<double>();
      ++used;
    }
    ++step_;
    if (used == 0) return;  // of this object no two pictures with features could be had
    losses_.Add(sum / used);
    torch::nn::utils::clip_grad_norm_(network_->parameters(), options_.gradient_clip);
    optimizer_->step();
    UpdateAverage(average_, *network_, options_.average_decay, step_);
  }

  Tensor LossOf(const SurfacePair& pair) const {
    std::vector<LightGlueAssignment> said;
    {
      const BFloat16Autocast autocast(torch::kCPU, ProcessorHasBFloat16());
      said = network_->Assignments(pair.reference.features, pair.query.features);
    }
    const TrueMatches truth = MatchSurfaces(pair.reference, pair.query);
    Tensor loss = LossOfLayer(said.back(), truth);
    for (std::size_t i = 0; i + 1 < said.size(); ++i) loss = loss + kWeightOfEarlierLayers * LossOfLayer(said[i], truth);
    return loss;
  }

  void SaveCheckpoint() {
    TensorFile file;
    file.metadata = {{"step", std::to_string(step_)}, {"minutes", std::to_string(Minutes())}};
    AddTrainingState(file, *network_, average_, *optimizer_);
    WriteSafetensors(options_.out / kCheckpoint, file);
  }

  void Resume() {
    const fs::path path = options_.out / kCheckpoint;
    if (!fs::exists(path)) throw BadFile(path.string(), "is missing, there is nothing to resume", "leave out --resume");
    const TensorFile file = SafetensorsReader(path).ReadAll();
    RestoreTrainingState(file, *network_, average_, *optimizer_);
    step_ = std::stoll(file.metadata.at("step"));
    minutes_before_ = std::stod(file.metadata.at("minutes"));
  }

  fs::path SaveAverage() const {
    TensorFile file;
    for (const auto& [name, tensor] : average_) file.tensors[kLighterGluePrefix + name] = ConvertTo(FromTorch(tensor), Dtype::kF16);
    file.metadata["training"] = Formatted("%lld steps, seed %llu", static_cast<long long>(step_), static_cast<unsigned long long>(options_.seed));
    SaveModel(options_.out, kObjectLighterGlueModel, file, "LighterGlue for views of one object from far apart", "Apache-2.0",
              "# " + std::string(kObjectLighterGlueModel) + "\n\nTrained by `antipode train matcher` from `" + options_.start + "`: " +
                  file.metadata["training"] + ".\n");
    return options_.out / kObjectLighterGlueModel;
  }

  const MatcherTrainingOptions& options_;
  const ProgressCallback& progress_;
  TensorFile weights_;
  PairLoader loader_;
  LightGlue network_;
  std::unique_ptr<torch::optim::AdamW> optimizer_;
  MovingAverage average_;
  std::int64_t step_ = 0;
  LossAverage losses_{kStepsOfAverage};
  double minutes_before_ = 0;
  Stopwatch stopwatch_;
};

}  // namespace

void MatcherTrainingOptions::Check() const {
  if (!(minutes > 0)) throw InvalidOption("minutes", "must be positive");
  if (iterations < 0) throw InvalidOption("iterations", "must not be negative");
  if (points < 16 || features < points) throw InvalidOption("points", "must be 16 to the number of features");
  if (variants < 1) throw InvalidOption("variants", "must be at least 1");
  if (!(learning_rate > 0)) throw InvalidOption("learning_rate", "must be positive");
  pairs.Check();
}

MatcherTrainingResult TrainMatcher(const MatcherTrainingOptions& options, const ProgressCallback& progress) {
  options.Check();
  fs::create_directories(options.out);
  return Trainer(options, progress).Run();
}

}  // namespace antipode
