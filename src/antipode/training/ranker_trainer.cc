#include "antipode/training/ranker_trainer.h"

#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <thread>
#include <utility>

#include "antipode/evaluation/prior_evaluation.h"
#include "antipode/geometry/rotation.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/precision.h"
#include "antipode/prior/correlation.h"
#include "antipode/prior/object_prior.h"
#include "antipode/training/batch_loader.h"
#include "antipode/training/loss_average.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/formatted.h"
#include "antipode/util/seeds.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using torch::Tensor;
namespace fs = std::filesystem;

constexpr double kSeparationDeg = 30, kPresentDeg = 30, kNearDeg = 10, kFarDeg = 45;
constexpr int kGroupsAtOnce = 1;  // more pictures at once are slower on the CPU
constexpr int kDraws = 100;

/// Degrees between rotations. [B, K, 3, 3], [B, 1, 3, 3] -> [B, K]
Tensor AnglesBetween(const Tensor& a, const Tensor& b) {
  return torch::acos((((a * b).sum({2, 3}) - 1) / 2).clamp(-1, 1)) * (180 / std::numbers::pi);
}

/// Codes of views, group by group, and the rotations of their cameras.
struct CodedGroups {
  Tensor codes;      ///< [G, V, C, H], half precision
  Tensor rotations;  ///< [G, V, 3, 3], camera_from_object
};

CodedGroups Encode(const ObjectPrior& prior, const ViewCache& cache, const RankerTrainingOptions& options,
                   const ProgressCallback& progress) {
  BatchLoader loader(cache, kGroupsAtOnce, options.views_per_group, prior.ViewOptions().size, options.augmentation, options.run.seed);
  std::vector<Tensor> codes, rotations;
  for (std::int64_t batch = 0; batch * kGroupsAtOnce < options.groups; ++batch) {
    if (progress) progress({"encoding views", batch * kGroupsAtOnce, options.groups, {}});
    const ViewBatch views = loader.Get(batch);
    const Tensor images = AugmentColors(views.rgba.to(torch::kFloat) / 255, views.groups, options.augmentation,
                                        CombineSeeds(options.run.seed + 1, static_cast<std::uint64_t>(batch)));
    const Tensor encoded = prior.EncodeImages(images).to(torch::kHalf);
    codes.push_back(encoded.view({views.groups, -1, encoded.size(1), encoded.size(2)}));
    rotations.push_back(ToTensor(views.Rotations()).view({views.groups, -1, 3, 3}));
  }
  return {torch::cat(codes), torch::cat(rotations)};
}

/// The maxima of many correlations on a grid of rotations.
class GridModes {
 public:
  GridModes(const RotationPosterior& posterior, double temperature, int count)
      : max_degree_(posterior.max_degree()), temperature_(temperature), count_(count), rotations_(ToTensor(posterior.grid()).flatten(1)) {
    wigner_ = ToTensor(WignerMatrices(posterior.grid(), posterior.max_degree()))
                  .t()
                  .to(ProcessorHasBFloat16() ? torch::kBFloat16 : torch::kFloat)
                  .contiguous();
  }

  struct Modes {
    Tensor rotations;  ///< [B, K, 3, 3], query_from_reference
    Tensor scores;     ///< [B, K], divided by the temperature
  };
  Modes Find(const Tensor& reference, const Tensor& query) const {
    const double separation_trace = 1 + 2 * std::cos(RadiansFromDegrees(kSeparationDeg));
    const Tensor correlations = CorrelateCodes(query, reference, max_degree_).to(wigner_.dtype());
    Tensor scores = torch::matmul(correlations, wigner_).to(torch::kFloat) / temperature_;
    std::vector<Tensor> rotations, best;
    for (int k = 0; k < count_; ++k) {
      const auto [value, index] = scores.max(1);
      const Tensor rotation = rotations_.index_select(0, index);
      rotations.push_back(rotation.view({-1, 3, 3}));
      best.push_back(value);
      scores.masked_fill_(torch::matmul(rotation, rotations_.t()) > separation_trace, -1e4);
    }
    return {torch::stack(rotations, 1), torch::stack(best, 1)};
  }

 private:
  int max_degree_;
  double temperature_;
  int count_;
  Tensor rotations_, wigner_;
};

/// Rotations turned by random vectors whose length is about `degrees`.
Tensor Disturbed(const Tensor& rotations, double degrees) {
  const Tensor v = torch::randn({rotations.size(0), rotations.size(1), 3}) * (RadiansFromDegrees(degrees) / std::sqrt(3.0));
  const auto part = v.unbind(2);
  const Tensor none = torch::zeros_like(part[0]);
  const Tensor skew = torch::stack({none, -part[2], part[1], part[2], none, -part[0], -part[1], part[0], none}, 2);
  return torch::matmul(torch::matrix_exp(skew.view({v.size(0), v.size(1), 3, 3})), rotations);
}

struct PairBatch {
  Tensor reference, query;  // [B, C, H]
  GridModes::Modes modes;
  Tensor target;            // [B, K], sums to 1
};

/// The second stage, and how much the scores of the first one weigh beside it.
struct JointRanker : torch::nn::Module {
  explicit JointRanker(const ModeRankerConfig& config)
      : ranker(register_module("ranker", ModeRanker(config))), score_weight(register_parameter("score_weight", torch::zeros({1}))) {}

  ModeRanker ranker;
  Tensor score_weight;  // before softplus, which makes 0.7 of 0
};

class Trainer {
 public:
  Trainer(const RankerTrainingOptions& options, const ObjectPrior& prior, const ProgressCallback& progress)
      : options_(options), grid_(prior.posterior(), prior.calibration().temperature, options.modes), right_(options.run.averaged_losses) {
    torch::manual_seed(options.run.seed);
    network_.emplace(options.ranker);
    std::map<std::string, std::string> configuration = options.ranker.ToMetadata();
    configuration["prior_sha256"] = FindModel(options.prior).sha256;
    run_.emplace(options.run, *network_, torch::optim::AdamWOptions().weight_decay(options.weight_decay), std::move(configuration), progress);
  }

  RankerTrainingResult Run(CodedGroups groups) {
    groups_ = std::move(groups);
    RankerTrainingResult result{run_->Run([this](std::int64_t) { return AddGradients(); })};
    run_->TakeAverage();
    result.share_right = right_.last();
    return result;
  }

  ModeRanker ranker() const { return network_->ranker; }

 private:
  /// At least one pair whose modes hold the truth.
  PairBatch DrawPairs() const {
    const torch::NoGradGuard no_gradient;
    for (int attempt = 0; attempt < kDraws; ++attempt) {
      PairBatch pairs = DrawPresentPairs();
      if (pairs.target.size(0) > 0) return pairs;
    }
    throw Error("training", "no pair has the true rotation among the hypotheses of the first stage", "train the prior for longer first");
  }

  /// Pairs of different views of one object, without those whose modes miss the truth.
  PairBatch DrawPresentPairs() const {
    const std::int64_t views = groups_.codes.size(1);
    const Tensor group = torch::randint(groups_.codes.size(0), {options_.batch}, torch::kLong);
    const Tensor i = torch::randint(views, {options_.batch}, torch::kLong);
    const Tensor j = (i + 1 + torch::randint(views - 1, {options_.batch}, torch::kLong)).remainder(views);
    const auto code = [&](const Tensor& view) { return groups_.codes.index({group, view}).to(torch::kFloat); };
    PairBatch pairs{code(i), code(j), {}, {}};
    pairs.modes = grid_.Find(pairs.reference, pairs.query);
    pairs.modes.rotations = Disturbed(pairs.modes.rotations, options_.rotation_noise_deg);
    const Tensor truth = torch::matmul(groups_.rotations.index({group, j}), groups_.rotations.index({group, i}).transpose(1, 2));
    const Tensor errors = AnglesBetween(pairs.modes.rotations, truth.unsqueeze(1));
    const Tensor present = (errors.amin(1) < kPresentDeg).nonzero().squeeze(1);
    const Tensor near = errors.index_select(0, present);
    const Tensor weights = torch::exp(-0.5 * (near / kNearDeg).square()) * (near < kFarDeg) + 1e-6;
    return {pairs.reference.index_select(0, present), pairs.query.index_select(0, present),
            {pairs.modes.rotations.index_select(0, present), pairs.modes.scores.index_select(0, present)},
            weights / weights.sum(1, true)};
  }

  double AddGradients() {
    const BFloat16Autocast autocast(torch::kCPU, ProcessorHasBFloat16());
    const PairBatch pairs = DrawPairs();
    const Tensor log_weights = network_->ranker->forward(pairs.reference, pairs.query, pairs.modes.rotations);
    const auto cross_entropy = [&](const Tensor& logits) { return -(torch::log_softmax(logits, 1) * pairs.target).sum(1).mean(); };
    const Tensor joint = log_weights + torch::softplus(network_->score_weight) * pairs.modes.scores;
    right_.Add((joint.argmax(1) == pairs.target.argmax(1)).to(torch::kFloat).mean().item<double>());
    const Tensor loss = cross_entropy(joint) + 0.5 * cross_entropy(log_weights);
    loss.backward();
    return loss.item<double>();
  }

  const RankerTrainingOptions& options_;
  CodedGroups groups_;
  GridModes grid_;
  std::optional<JointRanker> network_;
  LossAverage right_;
  std::optional<TrainingRun> run_;
};

/// The prior with this second stage.
TensorFile WithRanker(const TensorFile& file, ModeRankerImpl& ranker) {
  TensorFile prior = WithoutRanker(file);
  for (auto& [name, tensor] : WeightsOf(ranker).tensors) prior.tensors[kRankerPrefix + name] = ConvertTo(tensor, Dtype::kF16);
  for (const auto& [key, value] : ranker.config().ToMetadata()) prior.metadata[key] = value;
  return prior;
}

fs::path Save(const RankerTrainingOptions& options, const TensorFile& first_stage, ModeRankerImpl& ranker, const RankerTrainingResult& result) {
  TensorFile file = WithRanker(first_stage, ranker);
  const ModelEntry entry = FindModel(options.prior);
  const std::string training = Formatted("%lld steps, seed %llu, loss %.4f", static_cast<long long>(result.steps),
                                         static_cast<unsigned long long>(options.run.seed), result.last_loss);
  file.metadata["ranker_training"] = training;
  const std::string card = ReadFile(entry.file.parent_path() / "card.md") + "\nSecond stage trained by `antipode train ranker`: " + training + ".\n";
  SaveModel(options.run.out, "prior", file, entry.description, entry.licence, card);
  return options.run.out / "prior";
}

}  // namespace

void RankerTrainingOptions::Check() const {
  run.Check();
  if (groups < 1) throw InvalidOption("groups", "must be at least 1");
  if (views_per_group < 2) throw InvalidOption("views_per_group", "leaves no pair", "use at least 2");
  if (batch < 1) throw InvalidOption("batch", "must be at least 1");
  if (modes < 2) throw InvalidOption("modes", "leaves no choice", "use at least 2");
  ranker.Check();
  views.Check();
}

RankerTrainingResult TrainRanker(const RankerTrainingOptions& given, const ProgressCallback& progress) {
  RankerTrainingOptions options = given;
  const int processors = static_cast<int>(std::thread::hardware_concurrency());
  options.views.threads = options.threads > 0 ? options.threads : processors;
  torch::set_num_threads(options.views.threads);
  const ObjectPrior prior = ObjectPrior::Load(options.prior);
  const TensorFile first_stage = LoadModel(options.prior);
  options.ranker.max_degree = prior.posterior().max_degree();
  options.ranker.channels = 2 * ObjectEncoderConfig::FromMetadata(first_stage.metadata, options.prior).channels;
  options.Check();
  Trainer trainer(options, prior, progress);
  const fs::path& out = options.run.out;
  fs::create_directories(out);
  const fs::path folder = options.cache.empty() ? out / "cache" : options.cache;
  const ViewCache cache = ViewCache::OpenOrRender(folder, MeshCollection::Open(options.objects), options.views, progress);
  RankerTrainingResult result = trainer.Run(Encode(prior, cache, options, progress));
  result.model = Save(options, first_stage, *trainer.ranker(), result);
  if (!result.interrupted && !options.validation_objects.empty()) CalibrateModel(result.model, options.validation_objects);
  return result;
}

}  // namespace antipode
