#include "antipode/training/training_run.h"

#include <fstream>
#include <utility>
#include <vector>

#include "antipode/training/learning_rate.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

constexpr char kCheckpoint[] = "checkpoint.safetensors";
constexpr std::int64_t kStepsBetweenLines = 20;

std::vector<torch::Tensor> TrainedParameters(const torch::nn::Module& network) {
  std::vector<torch::Tensor> trained;
  for (const auto& parameter : network.parameters())
    if (parameter.requires_grad()) trained.push_back(parameter);
  return trained;
}

}  // namespace

void TrainingRunOptions::Check() const {
  if (!(minutes > 0)) throw InvalidOption("minutes", "must be positive");
  if (iterations < 0) throw InvalidOption("iterations", "must not be negative");
  if (!(learning_rate > 0)) throw InvalidOption("learning_rate", "must be positive");
}

TrainingRun::TrainingRun(const TrainingRunOptions& options, torch::nn::Module& network, torch::optim::AdamWOptions optimizer,
                         std::map<std::string, std::string> configuration, ProgressCallback progress)
    : options_(options),
      network_(network),
      configuration_(std::move(configuration)),
      progress_(std::move(progress)),
      optimizer_(TrainedParameters(network), std::move(optimizer)),
      average_(StartAverage(network)),
      losses_(options.averaged_losses) {
  if (options.resume) LoadCheckpoint();
}

double TrainingRun::Minutes() const { return minutes_before_ + stopwatch_.Seconds() / 60; }

double TrainingRun::Fraction() const {
  return options_.iterations > 0 ? static_cast<double>(step_) / options_.iterations : Minutes() / options_.minutes;
}

TrainingResult TrainingRun::Run(const AddGradients& add_gradients) {
  stopwatch_ = since_checkpoint_ = {};
  std::ofstream log(options_.out / "log.csv", options_.resume ? std::ios::app : std::ios::trunc);
  if (!options_.resume) log << "step,minutes,loss\n";
  TrainingResult result;
  while (Fraction() < 1 && !result.interrupted) {
    Step(add_gradients);
    if (step_ % kStepsBetweenLines == 0) log << step_ << ',' << Minutes() << ',' << losses_.last() << std::endl;
    if (progress_) progress_({"training", static_cast<std::int64_t>(1000 * Fraction()), 1000, Formatted("loss %.4f", losses_.last())});
    if (since_checkpoint_.Seconds() > 60 * options_.minutes_between_checkpoints) SaveCheckpoint();
    result.interrupted = InterruptRequested();
  }
  SaveCheckpoint();
  result.steps = step_;
  result.first_loss = losses_.first();
  result.last_loss = losses_.last();
  return result;
}

void TrainingRun::TakeAverage() {
  const torch::NoGradGuard no_gradient;
  for (auto& item : network_.named_parameters())
    if (item.value().requires_grad()) item.value().copy_(average_.at(item.key()));
}

void TrainingRun::Step(const AddGradients& add_gradients) {
  torch::manual_seed(CombineSeeds(options_.seed + 1, static_cast<std::uint64_t>(step_)));
  SetLearningRate(optimizer_, options_.learning_rate * LearningRateFactor(step_, options_.warm_up_steps, Fraction()));
  optimizer_.zero_grad();
  const std::optional<double> loss = add_gradients(step_);
  ++step_;
  if (!loss) return;
  losses_.Add(*loss);
  torch::nn::utils::clip_grad_norm_(network_.parameters(), options_.gradient_clip);
  optimizer_.step();
  UpdateAverage(average_, network_, options_.average_decay, step_ - 1);
}

void TrainingRun::SaveCheckpoint() {
  TensorFile file;
  file.metadata = configuration_;
  file.metadata["step"] = std::to_string(step_);
  file.metadata["minutes"] = std::to_string(Minutes());
  AddTrainingState(file, network_, average_, optimizer_);
  WriteSafetensors(options_.out / kCheckpoint, file);
  since_checkpoint_ = {};
}

void TrainingRun::LoadCheckpoint() {
  const std::filesystem::path path = options_.out / kCheckpoint;
  if (!std::filesystem::exists(path)) throw BadFile(path.string(), "is missing, there is nothing to resume", "leave out --resume");
  const TensorFile file = SafetensorsReader(path).ReadAll();
  for (const auto& [key, value] : configuration_) {
    const auto found = file.metadata.find(key);
    if (found == file.metadata.end() || found->second != value)
      throw BadFile(path.string(), "was made with another configuration (" + key + ")", "resume with the options it was started with");
  }
  RestoreTrainingState(file, network_, average_, optimizer_);
  step_ = std::stoll(file.metadata.at("step"));
  minutes_before_ = std::stod(file.metadata.at("minutes"));
}

}  // namespace antipode
