#include "antipode/prior/object_prior.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "antipode/geometry/spherical_harmonics.h"
#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/prior/correlation.h"
#include "antipode/util/error.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

struct CalibrationField {
  const char* name;
  double PriorCalibration::* value;
};
constexpr CalibrationField kCalibrationFields[] = {
    {"temperature", &PriorCalibration::temperature},
    {"mode_weight", &PriorCalibration::mode_weight},
    {"ranker_weight", &PriorCalibration::ranker_weight},
    {"confidence_slope", &PriorCalibration::confidence_slope},
    {"confidence_score_weight", &PriorCalibration::confidence_score_weight},
    {"confidence_offset", &PriorCalibration::confidence_offset},
};

constexpr int kWeighedModes = 8;
constexpr double kLevelWeight = 0.6;  // less than 1: the network knows already that most cameras are held level
constexpr double kLeastWeighedProbability = 5e-4;

/// s with Y(M x) = s Y(x) for the mirror M = diag(-1, 1, 1); every harmonic is even or odd in x.
torch::Tensor MirrorSigns(int max_degree) {
  const Eigen::Vector3d direction = Eigen::Vector3d(0.41, 0.53, 0.74).normalized();  // on no zero of a harmonic
  const Eigen::VectorXd here = SphericalHarmonics(direction, max_degree);
  const Eigen::VectorXd there = SphericalHarmonics(direction.cwiseProduct(Eigen::Vector3d(-1, 1, 1)), max_degree);
  auto signs = torch::empty({here.size()});
  for (Eigen::Index i = 0; i < here.size(); ++i) signs[i] = here[i] * there[i] > 0 ? 1.0f : -1.0f;
  return signs;
}

/// So that what the modes are weighed by can bring forward one that was not among the best.
PosteriorOptions WithAllModes(PosteriorOptions options) {
  options.max_modes = std::max(options.max_modes, kWeighedModes);
  options.least_probability = std::min(options.least_probability, kLeastWeighedProbability);
  return options;
}

/// Empty if the file has no second stage.
ModeRanker LoadRanker(const TensorFile& file, const std::string& source) {
  const TensorFile tensors = WithoutPrefix(file, kRankerPrefix);
  if (tensors.tensors.empty()) return nullptr;
  ModeRanker ranker(ModeRankerConfig::FromMetadata(file.metadata, source));
  LoadInto(*ranker, tensors, source);
  ranker->eval();
  return ranker;
}

}  // namespace

TensorFile WithoutRanker(TensorFile file) {
  std::erase_if(file.tensors, [](const auto& item) { return item.first.starts_with(kRankerPrefix); });
  return file;
}

void Reweigh(std::vector<RotationMode>& modes, const PriorCalibration& calibration, CameraRoll roll) {
  std::vector<double> logits;
  double total = 0;
  for (const RotationMode& mode : modes) {
    total += mode.probability;
    logits.push_back(calibration.mode_weight * LogProbability(mode) + calibration.ranker_weight * mode.log_weight);
    if (roll == CameraRoll::kLevel) logits.back() += kLevelWeight * LogDensityOfLevelCameras(mode.rotation);
  }
  const double highest = *std::ranges::max_element(logits);
  double sum = 0;
  for (double& logit : logits) sum += logit = std::exp(logit - highest);
  for (std::size_t k = 0; k < modes.size(); ++k) {
    const double before = std::exp(LogProbability(modes[k]));
    modes[k].probability = total * logits[k] / sum;
    modes[k].reweighting = modes[k].probability / before;
  }
  std::ranges::stable_sort(modes, std::ranges::greater(), &RotationMode::probability);
}

std::map<std::string, std::string> PriorCalibration::ToMetadata() const {
  std::map<std::string, std::string> metadata;
  for (const auto& field : kCalibrationFields) metadata[field.name] = std::to_string(this->*field.value);
  return metadata;
}

PriorCalibration PriorCalibration::FromMetadata(const std::map<std::string, std::string>& metadata,
                                                const std::string& file) {
  PriorCalibration calibration;
  for (const auto& field : kCalibrationFields) {
    const auto entry = metadata.find(field.name);
    if (entry == metadata.end()) continue;
    char* end = nullptr;
    calibration.*field.value = std::strtod(entry->second.c_str(), &end);
    if (end == entry->second.c_str() || *end != '\0' || !std::isfinite(calibration.*field.value))
      throw BadFile(file, std::string("its metadata has a malformed ") + field.name, "restore the file");
  }
  if (!(calibration.temperature > 0)) throw BadFile(file, "its temperature is not positive", "restore the file");
  return calibration;
}

torch::Tensor EncoderInput(std::span<const ObjectView> views, int size) {
  auto pixels = torch::empty({static_cast<std::int64_t>(views.size()), size, size, 3}, torch::kUInt8);
  auto* destination = pixels.data_ptr<std::uint8_t>();
  for (const ObjectView& view : views) {
    if (view.image.cols != size || view.image.rows != size || view.image.type() != CV_8UC3)
      throw Error("object prior", "was given a crop of another size", "crop with ObjectPrior::ViewOptions()");
    const cv::Mat image = view.image.isContinuous() ? view.image : view.image.clone();
    std::copy_n(image.ptr<std::uint8_t>(), image.total() * 3, destination);
    destination += image.total() * 3;
  }
  return pixels.permute({0, 3, 1, 2}).to(torch::kFloat) / 255;
}

ObjectPrior ObjectPrior::Load(const std::string& model_or_folder, torch::Device device) {
  const TensorFile file = LoadModel(model_or_folder);
  ObjectEncoder encoder(ObjectEncoderConfig::FromMetadata(file.metadata, model_or_folder));
  LoadInto(*encoder, WithoutRanker(file), model_or_folder);
  encoder->backbone->AbsorbNormalization();
  return ObjectPrior(std::move(encoder), device, PriorCalibration::FromMetadata(file.metadata, model_or_folder),
                     LoadRanker(file, model_or_folder));
}

ObjectPrior::ObjectPrior(ObjectEncoder encoder, torch::Device device, const PriorCalibration& calibration, ModeRanker ranker)
    : encoder_(std::move(encoder)),
      ranker_(std::move(ranker)),
      device_(device),
      calibration_(calibration),
      mirror_signs_(MirrorSigns(encoder_->config().max_degree)),
      posterior_(std::make_shared<RotationPosterior>(encoder_->config().max_degree)) {
  encoder_->to(device);
  encoder_->eval();
}

ObjectViewOptions ObjectPrior::ViewOptions() const {
  ObjectViewOptions options;
  options.size = encoder_->config().image_size;
  return options;
}

torch::Tensor ObjectPrior::Encode(std::span<const ObjectView> views) const {
  return EncodeImages(EncoderInput(views, encoder_->config().image_size));
}

torch::Tensor ObjectPrior::EncodeImages(const torch::Tensor& images) const {
  const torch::InferenceMode inference;
  const torch::Tensor here = images.to(device_);
  ObjectEncoder encoder = encoder_;
  const auto both = encoder->forward(torch::cat({here, here.flip(3)})).to(torch::kCPU).chunk(2);
  // Two codes in one, so that the score of a pair is the mean of both scores.
  const auto codes = torch::cat({both[0], both[1] * mirror_signs_}, 1) * std::sqrt(0.5);
  if (!torch::isfinite(codes).all().item<bool>())
    throw Error("object prior", "the network's output is not finite", "verify the weights: antipode models verify");
  return codes;
}

torch::Tensor ObjectPrior::JoinViews(const torch::Tensor& codes, std::span<const Eigen::Matrix3d> crop_from_object) const {
  const torch::InferenceMode inference;
  torch::Tensor sum = torch::zeros_like(codes[0]);
  for (std::size_t i = 0; i < crop_from_object.size(); ++i)
    sum += TurnCode(codes[static_cast<std::int64_t>(i)], crop_from_object[i].transpose());
  return sum / static_cast<double>(std::max<std::size_t>(1, crop_from_object.size()));
}

Eigen::VectorXf ObjectPrior::Correlation(const torch::Tensor& reference_code,
                                         const torch::Tensor& query_code) const {
  const torch::InferenceMode inference;
  const auto correlation =
      CorrelateCodes(query_code.unsqueeze(0), reference_code.unsqueeze(0), posterior_->max_degree())
          .contiguous();
  return Eigen::Map<const Eigen::VectorXf>(correlation.const_data_ptr<float>(), correlation.numel());
}

std::vector<RotationMode> ObjectPrior::Compare(const torch::Tensor& reference_code,
                                               const torch::Tensor& query_code,
                                               PosteriorOptions options, CameraRoll roll) const {
  std::vector<RotationMode> modes = WeighedModes(reference_code, query_code, options, roll);
  KeepReportable(modes, options);
  return modes;
}

std::vector<RotationMode> ObjectPrior::CompareWithJoined(const torch::Tensor& joined_code, const torch::Tensor& query_code,
                                                         PosteriorOptions options) const {
  options.temperature *= calibration_.temperature;
  return posterior_->FindModes(Correlation(joined_code, query_code), options);
}

std::vector<RotationMode> ObjectPrior::WeighedModes(const torch::Tensor& reference_code, const torch::Tensor& query_code,
                                                    PosteriorOptions options, CameraRoll roll) const {
  options.temperature *= calibration_.temperature;
  if (roll == CameraRoll::kLevel) options = WithAllModes(options);
  std::vector<RotationMode> modes = Hypotheses(reference_code, query_code, options);
  if (HasSecondStage() || roll == CameraRoll::kLevel) Reweigh(modes, calibration_, roll);
  return modes;
}

std::vector<RotationMode> ObjectPrior::Hypotheses(const torch::Tensor& reference_code, const torch::Tensor& query_code,
                                                  PosteriorOptions options) const {
  const Eigen::VectorXf correlation = Correlation(reference_code, query_code);
  if (!HasSecondStage()) return posterior_->FindModes(correlation, options);
  std::vector<RotationMode> modes = posterior_->FindModes(correlation, WithAllModes(options));
  ModeRanker ranker = ranker_;
  const std::vector<double> log_weights = ranker->LogWeights(reference_code, query_code, modes);
  for (std::size_t k = 0; k < modes.size(); ++k) modes[k].log_weight = log_weights[k];
  return modes;
}

GridPosterior ObjectPrior::OnGrid(const torch::Tensor& reference_code, const torch::Tensor& query_code,
                                  std::span<const RotationMode> modes) const {
  GridPosterior posterior = posterior_->OnGrid(Correlation(reference_code, query_code), {.temperature = calibration_.temperature});
  for (const RotationMode& mode : modes)
    if (mode.reweighting != 1) posterior.ScaleAround(mode.rotation, mode.reweighting);
  posterior.weights /= posterior.weights.sum();
  return posterior;
}

double ObjectPrior::Confidence(const RotationMode& best) const {
  const double log_odds = calibration_.confidence_slope * LogOdds(best.probability) +
                          calibration_.confidence_score_weight * best.score + calibration_.confidence_offset;
  return Logistic(log_odds);
}

}  // namespace antipode
