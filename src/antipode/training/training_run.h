#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include <torch/torch.h>

#include "antipode/training/loss_average.h"
#include "antipode/training/training_state.h"
#include "antipode/util/progress.h"
#include "antipode/util/stopwatch.h"

namespace antipode {

struct TrainingRunOptions {
  std::filesystem::path out{}; ///< folder for checkpoint.safetensors and log.csv
  double minutes = 60;         ///< time budget, counted over all resumed runs
  int iterations = 0;          ///< if positive, the budget instead of `minutes`
  double learning_rate = 1e-3; ///< highest; falls along a cosine
  int warm_up_steps = 0;       ///< see LearningRateFactor
  double gradient_clip = 1.0;
  double average_decay = 0.999; ///< of the exponential moving average that is saved as the model
  int averaged_losses = 20;    ///< steps over which the losses of the result are means
  double minutes_between_checkpoints = 5;
  bool resume = false;
  std::uint64_t seed = 1;
  void Check() const;
};

struct TrainingResult {
  std::int64_t steps = 0;                 ///< of all resumed runs together
  double first_loss = 0, last_loss = 0;  ///< means of the first and the last steps of this run
  bool interrupted = false;
  std::filesystem::path model;
};

/// Trains a network step by step until the budget is used up or the user asks for an end, and leaves a checkpoint from which
/// the next run goes on as if there had been no break. The log has the columns step, minutes, loss.
///
/// Random numbers of PyTorch depend on the seed and the step alone.
class TrainingRun {
 public:
  /// Adds the gradients of the batch of a step to those of the network; answers with the loss, or nothing where the batch
  /// holds nothing to learn from.
  using AddGradients = std::function<std::optional<double>(std::int64_t step)>;

  /// @param network of it the parameters are trained that want a gradient; valid as long as this
  /// @param optimizer its learning rate does not matter
  /// @param configuration what a checkpoint must agree with to be resumed
  /// @throws BadFile if there is no checkpoint to resume, or it is of another configuration
  TrainingRun(const TrainingRunOptions& options, torch::nn::Module& network, torch::optim::AdamWOptions optimizer,
              std::map<std::string, std::string> configuration, ProgressCallback progress);

  /// @return without the model
  TrainingResult Run(const AddGradients& add_gradients);

  /// The exponential moving average of the parameters, which is what should be kept of them.
  const MovingAverage& average() const { return average_; }

  /// Puts the average in the place of the trained parameters.
  void TakeAverage();

 private:
  double Minutes() const;
  double Fraction() const;
  void Step(const AddGradients& add_gradients);
  void SaveCheckpoint();
  void LoadCheckpoint();

  TrainingRunOptions options_;
  torch::nn::Module& network_;
  std::map<std::string, std::string> configuration_;
  ProgressCallback progress_;
  torch::optim::AdamW optimizer_;
  MovingAverage average_;
  LossAverage losses_;
  std::int64_t step_ = 0;
  double minutes_before_ = 0;
  Stopwatch stopwatch_, since_checkpoint_;
};

}  // namespace antipode
