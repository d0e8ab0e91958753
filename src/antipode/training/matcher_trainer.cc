#include "antipode/training/matcher_trainer.h"

#include <deque>
#include <future>
#include <optional>
#include <utility>

#include "antipode/matching/light_glue.h"
#include "antipode/matching/xfeat_matcher.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/nn/precision.h"
#include "antipode/render/mesh_collection.h"
#include "antipode/training/mesh_variants.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/seeds.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using torch::Tensor;
namespace fs = std::filesystem;

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
    std::mt19937_64 random(CombineSeeds(options_.run.seed, static_cast<std::uint64_t>(step)));
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
      : options_(options), weights_(LoadLighterGlueModel(options.start)), loader_(options, weights_),
        network_(LightGlueConfig::LighterGlue()) {
    LoadInto(*network_, WithoutPrefix(weights_, kLighterGluePrefix), options.start);
    run_.emplace(options.run, *network_, torch::optim::AdamWOptions().weight_decay(0), std::map<std::string, std::string>{}, progress);
  }

  TrainingResult Run() {
    TrainingResult result = run_->Run([this](std::int64_t step) { return AddGradients(step); });
    result.model = SaveAverage(result.steps);
    return result;
  }

 private:
  /// Nothing where of an object no two pictures with features could be had.
  std::optional<double> AddGradients(std::int64_t step) {
    const std::vector<SurfacePair> pairs = loader_.Get(step);
    double sum = 0;
    int used = 0;
    for (const SurfacePair& pair : pairs) {
      if (std::min(pair.reference.features.size(), pair.query.features.size()) < kLeastFeatures) continue;
      const Tensor loss = LossOf(Thinned(pair, options_.points));
      (loss / static_cast<double>(pairs.size())).backward();
      sum += loss.item<double>();
      ++used;
    }
    return used > 0 ? std::optional(sum / used) : std::nullopt;
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

  fs::path SaveAverage(std::int64_t steps) const {
    TensorFile file;
    for (const auto& [name, tensor] : run_->average()) file.tensors[kLighterGluePrefix + name] = ConvertTo(FromTorch(tensor), Dtype::kF16);
    file.metadata["training"] = Formatted("%lld steps, seed %llu", static_cast<long long>(steps), static_cast<unsigned long long>(options_.run.seed));
    SaveModel(options_.run.out, kObjectLighterGlueModel, file, "LighterGlue for views of one object from far apart", "Apache-2.0",
              "# " + std::string(kObjectLighterGlueModel) + "\n\nTrained by `antipode train matcher` from `" + options_.start + "`: " +
                  file.metadata["training"] + ".\n");
    return options_.run.out / kObjectLighterGlueModel;
  }

  const MatcherTrainingOptions& options_;
  TensorFile weights_;
  PairLoader loader_;
  LightGlue network_;
  std::optional<TrainingRun> run_;
};

}  // namespace

void MatcherTrainingOptions::Check() const {
  run.Check();
  if (points < 16 || features < points) throw InvalidOption("points", "must be 16 to the number of features");
  if (variants < 1) throw InvalidOption("variants", "must be at least 1");
  pairs.Check();
}

TrainingResult TrainMatcher(const MatcherTrainingOptions& options, const ProgressCallback& progress) {
  options.Check();
  fs::create_directories(options.run.out);
  return Trainer(options, progress).Run();
}

}  // namespace antipode
