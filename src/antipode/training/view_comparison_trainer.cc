#include "antipode/training/view_comparison_trainer.h"

#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "antipode/gen6d/losses.h"
#include "antipode/gen6d/shared_backbone.h"
#include "antipode/geometry/rotation.h"
#include "antipode/nn/module_weights.h"
#include "antipode/training/loss_average.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/seeds.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using torch::Tensor;
namespace fs = std::filesystem;

Tensor ToTensor(const Eigen::MatrixXd& matrix) {
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = matrix;
  return torch::from_blob(const_cast<double*>(rows.data()), {rows.rows(), rows.cols()}, torch::kDouble).to(torch::kFloat).clone();
}

/// Where the object is in a query, with the errors that masks make.
QueryCrop JitteredCrop(const PosedPicture& query, std::mt19937_64& random) {
  const NormalizedView normalized = NormalizeUnrotated(query.intrinsics, query.camera_from_object);
  const auto difference = InPlaneDifferenceOf(normalized.intrinsics, normalized.camera_from_object, query.intrinsics, query.camera_from_object);
  const double scale = difference.scale * std::exp2(UniformIn(random, -0.25, 0.15));
  const Eigen::Vector2d centre = (query.intrinsics * query.camera_from_object.translation).hnormalized();
  return {centre + scale * Eigen::Vector2d(UniformIn(random, -6, 6), UniformIn(random, -6, 6)), scale};
}

/// Of one step; `uninformed` is the loss of a network that says nothing.
struct StepLoss {
  Tensor loss;
  double uninformed = 0;
};

class SelectorStep {
 public:
  SelectorStep(Selector selector, int views) : selector_(std::move(selector)), views_(views) {}

  StepLoss Loss(const PosedObject& object, int queries, std::mt19937_64& random) {
    std::vector<PosedPicture> references;
    for (const std::size_t i : DrawDistinct<std::size_t>(views_, object.views.size(), random)) references.push_back(object.views[i]);
    const SelectorReferences prepared = PrepareReferences(selector_, references);
    SelectorFeatures features;  // inference tensors take no part in training
    for (const Tensor& level : prepared.features) features.push_back(level.clone());

    std::vector<cv::Mat> crops;
    std::vector<Tensor> scores;
    std::vector<float> angles;
    std::vector<std::int64_t> nearest;
    for (int i = 0; i < queries; ++i) {
      const auto& group = object.groups[UniformIndex(random, object.groups.size())].queries;
      const PosedPicture& query = group[UniformIndex(random, group.size())];
      crops.push_back(CropQuery(query.rgb, JitteredCrop(query, random), {}));
      AddTargets(prepared.views, query, scores, angles, nearest);
    }
    const SelectorOutput output = selector_->forward(selector_->Features(ToImages(crops)), features, prepared.viewpoints.clone());
    const auto loss = [&](const SelectorOutput& answer) {
      return (ViewSelectionLoss(answer.logits, torch::stack(scores)) +
              InPlaneAngleLoss(answer.angles, torch::tensor(angles), torch::tensor(nearest, torch::kLong)))
          .mean();
    };
    return {loss(output), loss({torch::zeros_like(output.logits), torch::zeros_like(output.angles)}).item<double>()};
  }

 private:
  static void AddTargets(const std::vector<NormalizedView>& views, const PosedPicture& query, std::vector<Tensor>& scores,
                         std::vector<float>& angles, std::vector<std::int64_t>& nearest) {
    std::vector<float> cosines;
    const Eigen::Vector3d direction = query.camera_from_object.OriginInSource().normalized();
    for (const NormalizedView& view : views)
      cosines.push_back(static_cast<float>(direction.dot(view.camera_from_object.OriginInSource().normalized())));
    const auto best = std::ranges::max_element(cosines) - cosines.begin();
    const NormalizedView& view = views[best];
    angles.push_back(static_cast<float>(
        InPlaneDifferenceOf(view.intrinsics, view.camera_from_object, query.intrinsics, query.camera_from_object).angle));
    scores.push_back(torch::tensor(cosines));
    nearest.push_back(best);
  }

  Selector selector_;
  int views_;
};

class RefinerStep {
 public:
  explicit RefinerStep(Refiner refiner) : refiner_(std::move(refiner)) {}

  StepLoss Loss(const PosedObject& object, int most_queries, std::mt19937_64& random) {
    const QueryGroup& group = object.groups[UniformIndex(random, object.groups.size())];
    const PosedPicture& first = group.queries.front();
    const RefinementInput input = PrepareRefinement(object.views, {first.rgb, first.intrinsics}, group.coarse_camera_from_object);
    const Rigid3& pose = input.query.camera_from_object;
    const Tensor centre = ToTensor(pose.translation.transpose());
    const Tensor points = torch::matmul(VolumePoints(pose, kLossGrid), ToTensor(pose.rotation).t()) + centre;

    std::vector<cv::Mat> pictures;
    std::vector<Tensor> targets;
    for (const std::size_t i : DrawDistinct<std::size_t>(most_queries, group.queries.size(), random)) {
      const PosedPicture& query = group.queries[i];
      pictures.push_back(WarpPicture(query.rgb, input.query.normalized_pixel_from_pixel, Refiner::Impl::kImageSize, 255));
      const Rigid3 truth = Rigid3{input.query.normalized_from_camera, Eigen::Vector3d::Zero()} * query.camera_from_object;
      targets.push_back(ToTensor(SimilarityOf(ChangeBetween(input.query.intrinsics, pose, input.query.intrinsics, truth), pose)));
    }
    const auto count = static_cast<std::int64_t>(targets.size());
    const RefinerOutput output = refiner_->ForwardTogether(refiner_->Features(ToImages(pictures)), CameraOf(input.query),
                                                           refiner_->Features(ToImages(input.reference_pictures)), CamerasOf(input.references));
    const auto loss = [&](const RefinerOutput& change) {
      return PoseChangeLoss(change, points.expand({count, -1, -1}), centre.expand({count, -1}), torch::stack(targets)).mean();
    };
    const RefinerOutput unchanged{torch::tensor({{1.f, 0.f, 0.f, 0.f}}).expand({count, 4}), torch::zeros({count, 2}), torch::zeros({count, 1})};
    return {loss(output), loss(unchanged).item<double>()};
  }

 private:
  static constexpr std::int64_t kLossGrid = 8;

  Refiner refiner_;
};

/// What both have in common.
template <typename Network, typename Step>
class Training {
 public:
  Training(const ViewComparisonTrainingOptions& options, Network network, std::string name, const ProgressCallback& progress)
      : options_(options), network_(std::move(network)), name_(std::move(name)), progress_(progress),
        backbone_(LoadSharedBackbone(options.backbone_model)), uninformed_(options.run.averaged_losses) {
    InitializeRest();
    std::map<std::string, std::string> configuration = network_->config().ToMetadata();
    configuration["backbone_sha256"] = backbone_.sha256;
    run_.emplace(options.run, *network_, torch::optim::AdamWOptions().weight_decay(options.weight_decay), std::move(configuration),
                 [this](const Progress& progress) { Report(progress); });
  }

  ViewComparisonTrainingResult Run(Step step) {
    const std::vector<PosedObject> objects = RenderPosedObjects(options_.objects, options_.rendering, progress_);
    fs::create_directories(options_.run.out);
    const auto add_gradients = [&](std::int64_t index) {
      std::mt19937_64 random(CombineSeeds(options_.run.seed, static_cast<std::uint64_t>(index)));
      const StepLoss of_step = step.Loss(objects[UniformIndex(random, objects.size())], options_.batch, random);
      of_step.loss.backward();
      uninformed_.Add(of_step.uninformed);
      return of_step.loss.template item<double>();
    };
    ViewComparisonTrainingResult result{run_->Run(add_gradients)};
    run_->TakeAverage();
    result.uninformed_loss = uninformed_.last();
    result.model = Save(result);
    return result;
  }

 private:
  /// Some layers are made without values.
  void InitializeRest() {
    const torch::NoGradGuard no_gradient;
    torch::manual_seed(options_.run.seed);
    for (auto& item : network_->named_parameters()) {
      if (IsBackbone(item.key())) {
        item.value().set_requires_grad(false);
      } else if (item.value().dim() >= 2) {
        const double bound = std::sqrt(3.0 / (item.value().numel() / item.value().size(0)));
        item.value().uniform_(-bound, bound);
      } else {
        item.value().fill_(item.key().ends_with("norm.weight") ? 1 : 0);
      }
    }
    // A refiner that changes nothing is the best that can be said at first.
    for (auto& item : network_->named_parameters()) {
      if (!item.key().starts_with("regressor.fc") || item.key().starts_with("regressor.fc.")) continue;
      item.value().mul_(0.05);
      if (item.key() == "regressor.fcr.bias") item.value()[0] = 1;
    }
    LoadBesideBackbone(*network_, WithoutBackbone(WeightsOf(*network_)), backbone_, options_.backbone_model);
  }

  void Report(Progress progress) const {
    if (!progress_) return;
    progress.detail += Formatted(", %.4f if it said nothing", uninformed_.last());
    progress_(progress);
  }

  fs::path Save(const ViewComparisonTrainingResult& result) {
    TensorFile file = WithoutBackbone(WeightsOf(*network_));
    for (auto& [name, tensor] : file.tensors) tensor = ConvertTo(tensor, Dtype::kF16);
    file.metadata = network_->config().ToMetadata();
    file.metadata["backbone_model"] = options_.backbone_model;
    file.metadata["backbone_sha256"] = backbone_.sha256;
    file.metadata["steps"] = std::to_string(result.steps);
    SaveModel(options_.run.out, name_, file, "Gen6D's " + name_ + ", trained on rendered objects", "Apache-2.0",
              "# " + name_ + "\n\nTrained by `antipode train " + name_ + "`: " + std::to_string(result.steps) + " steps, seed " +
                  std::to_string(options_.run.seed) +
                  Formatted(", loss %.4f (%.4f for a network that says nothing).\n", result.last_loss, result.uninformed_loss));
    return options_.run.out / name_;
  }

  const ViewComparisonTrainingOptions& options_;
  Network network_;
  std::string name_;
  const ProgressCallback& progress_;
  SharedBackbone backbone_;
  LossAverage uninformed_;
  std::optional<TrainingRun> run_;
};

}  // namespace

void ViewComparisonTrainingOptions::Check() const {
  run.Check();
  if (batch < 1) throw InvalidOption("batch", "must be at least 1");
  if (views < 8) throw InvalidOption("views", "is " + std::to_string(views), "use at least 8");
  rendering.Check();
}

SelectorConfig BuiltInSelector() {
  return {.backbone = BackboneKind::kEfficientNetLite0, .correlation_width = 24, .width = 120, .heads = 8};
}

RefinerConfig BuiltInRefiner() {
  return {.backbone = BackboneKind::kEfficientNetLite0, .finest_stride = 8, .feature_width = 16, .volume_width = 12, .grid = 16,
          .regressor_width = 128};
}

ViewComparisonTrainingResult TrainSelector(const ViewComparisonTrainingOptions& options, const SelectorConfig& config,
                                           const ProgressCallback& progress) {
  options.Check();
  const Selector selector(config);
  return Training<Selector, SelectorStep>(options, selector, "selector", progress).Run(SelectorStep(selector, options.views));
}

ViewComparisonTrainingResult TrainRefiner(const ViewComparisonTrainingOptions& options, const RefinerConfig& config,
                                          const ProgressCallback& progress) {
  options.Check();
  const Refiner refiner(config);
  return Training<Refiner, RefinerStep>(options, refiner, "refiner", progress).Run(RefinerStep(refiner));
}

}  // namespace antipode
