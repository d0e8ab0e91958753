#include "antipode/training/upright_trainer.h"

#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>
#include <vector>

#include "antipode/nn/module_weights.h"
#include "antipode/orientation/orientation.h"
#include "antipode/training/augmentation.h"
#include "antipode/training/learning_rate.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

constexpr std::size_t kEncodedAtOnce = 64;

struct CodedViews {
  torch::Tensor codes;  // [N, code size], in standard deviations
  torch::Tensor ups;    // [N, 3]
  double deviation = 1;
};

/// The picture on white, as MakeObjectView would give it.
ObjectView OnWhite(const cv::Mat& rgba) {
  ObjectView view;
  view.image.create(rgba.size(), CV_8UC3);
  for (int y = 0; y < rgba.rows; ++y) {
    for (int x = 0; x < rgba.cols; ++x) {
      const auto& pixel = rgba.at<cv::Vec4b>(y, x);
      for (int c = 0; c < 3; ++c)
        view.image.at<cv::Vec3b>(y, x)[c] = static_cast<std::uint8_t>((pixel[c] * pixel[3] + 255 * (255 - pixel[3])) / 255);
    }
  }
  return view;
}

class CodeCollector {
 public:
  CodeCollector(const ViewCache& cache, const ObjectPrior& prior, const UprightTrainingOptions& options)
      : cache_(cache), prior_(prior), options_(options), random_(options.seed) {}

  CodedViews Collect(const ProgressCallback& progress) {
    for (int group = 0; group < cache_.group_count(); ++group) {
      if (progress && group % 16 == 0) progress({"encoding views", group, cache_.group_count(), {}});
      for (int i = 0; i < options_.views_per_variant; ++i) Add(group);
    }
    Encode();
    CodedViews views{torch::cat(codes_), torch::stack(ups_)};
    views.deviation = views.codes.std().item<double>();
    views.codes /= views.deviation;
    return views;
  }

 private:
  void Add(int group) {
    const AugmentationOptions augmentation;
    const int view = std::uniform_int_distribution<int>(0, cache_.views_per_group() - 1)(random_);
    const double roll = DrawRoll(DrawRegime(augmentation, random_), augmentation, random_);
    const bool mirrored = std::bernoulli_distribution(augmentation.mirror_share)(random_);
    const int size = prior_.ViewOptions().size;
    const AugmentedView augmented = AugmentView(cache_, group, view, roll, mirrored, size, augmentation, random_);
    const Eigen::Vector3f up = augmented.camera_from_object.rotation.col(1).cast<float>();
    ups_.push_back(torch::tensor({up.x(), up.y(), up.z()}));
    pictures_.push_back(OnWhite(augmented.rgba));
    if (pictures_.size() == kEncodedAtOnce) Encode();
  }

  void Encode() {
    if (pictures_.empty()) return;
    codes_.push_back(prior_.Encode(pictures_).flatten(1));
    pictures_.clear();
  }

  const ViewCache& cache_;
  const ObjectPrior& prior_;
  const UprightTrainingOptions& options_;
  std::mt19937_64 random_;
  std::vector<ObjectView> pictures_;
  std::vector<torch::Tensor> codes_, ups_;
};

/// Mean distance between directions, and the cross-entropy of being within 15 degrees.
torch::Tensor LossOf(const UprightReadoutImpl::Output& output, const torch::Tensor& ups) {
  const double near = 2 * std::sin(0.5 * 15 * std::numbers::pi / 180);  // length of the chord
  const auto distances = (output.up - ups).norm(2, 1);
  const auto is_near = (distances.detach() < near).to(torch::kFloat);
  return distances.mean() + torch::binary_cross_entropy_with_logits(output.log_odds, is_near).mean();
}

double Train(UprightReadout& readout, const CodedViews& views, const UprightTrainingOptions& options, const ProgressCallback& progress) {
  torch::manual_seed(options.seed);
  torch::optim::AdamW optimizer(readout->parameters(), torch::optim::AdamWOptions(options.learning_rate).weight_decay(options.weight_decay));
  double loss_average = 0;
  for (int step = 0; step < options.steps; ++step) {
    SetLearningRate(optimizer, options.learning_rate * LearningRateFactor(step, 0, static_cast<double>(step) / options.steps, 0));
    const auto rows = torch::randint(views.codes.size(0), {options.batch}, torch::kLong);
    const auto codes = views.codes.index_select(0, rows);
    const auto noisy = torch::dropout(codes + options.noise * torch::randn_like(codes), options.dropout, true);
    const auto loss = LossOf(readout->forward(noisy), views.ups.index_select(0, rows));
    optimizer.zero_grad();
    loss.backward();
    optimizer.step();
    const double value = loss.item<double>();
    loss_average = step == 0 ? value : 0.99 * loss_average + 0.01 * value;
    if (progress && step % 20 == 0) progress({"training", step, options.steps, {}});
  }
  return loss_average;
}

}  // namespace

void UprightTrainingOptions::Check() const {
  if (views_per_variant < 1) throw InvalidOption("views_per_variant", "must be at least 1");
  if (hidden < 1 || hidden > 4096) throw InvalidOption("hidden", "must be 1 to 4096");
  if (steps < 1 || batch < 1) throw InvalidOption("steps", "must be at least 1");
  if (!(learning_rate > 0)) throw InvalidOption("learning_rate", "must be positive");
  if (!(dropout >= 0 && dropout < 1)) throw InvalidOption("dropout", "must be at least 0 and less than 1");
  views.Check();
}

UprightTrainingResult TrainUpright(const UprightTrainingOptions& options, const ObjectPrior& prior, const std::string& prior_sha256,
                                   const ProgressCallback& progress) {
  options.Check();
  const std::filesystem::path folder = options.cache.empty() ? options.out / "cache" : options.cache;
  const ViewCache cache = ViewCache::OpenOrRender(folder, MeshCollection::Open(options.objects), options.views, progress);
  const CodedViews views = CodeCollector(cache, prior, options).Collect(progress);
  UprightReadout readout(views.codes.size(1), options.hidden);
  InitializeForTraining(*readout, options.seed);
  const double loss = Train(readout, views, options, progress);
  {
    const torch::NoGradGuard no_gradient;
    readout->named_parameters()["hidden.weight"] /= views.deviation;  // so that it takes codes as they are
  }
  TensorFile file = WeightsOf(*readout);
  for (auto& [name, tensor] : file.tensors) tensor = ConvertTo(tensor, Dtype::kF16);
  file.metadata = {{"architecture", "upright-readout-1"}, {"prior_sha256", prior_sha256}};
  char card[256];
  std::snprintf(card, sizeof card, "# upright\n\nTrained by `antipode train upright` on %lld views: %d steps, seed %llu, loss %.4f.\n",
                static_cast<long long>(views.codes.size(0)), options.steps, static_cast<unsigned long long>(options.seed), loss);
  SaveModel(options.out, "upright", file, "Which way is up in a picture, from the prior's code", "Apache-2.0", card);
  return {loss, options.out / "upright"};
}

}  // namespace antipode
