#include "antipode/training/training_run.h"

#include <gtest/gtest.h>

#include "antipode/util/error.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

/// A line that learns 2 x + 1.
class Line {
 public:
  Line() {
    const torch::NoGradGuard no_gradient;
    for (auto& parameter : layer_->parameters()) parameter.zero_();
  }

  TrainingRun MakeRun(const TrainingRunOptions& options, const std::string& shape = "line") {
    return {options, *layer_, torch::optim::AdamWOptions().weight_decay(0), {{"shape", shape}}, {}};
  }

  double AddGradients() {
    const torch::Tensor x = torch::rand({16, 1});
    const torch::Tensor loss = (layer_->forward(x) - (2 * x + 1)).square().mean();
    loss.backward();
    return loss.item<double>();
  }

  double At(double x) const { return layer_->weight.item<double>() * x + layer_->bias.item<double>(); }

 private:
  torch::nn::Linear layer_{1, 1};
};

TrainingRunOptions Options(const TemporaryFolder& folder, int iterations) {
  return {.out = folder.path(), .iterations = iterations, .learning_rate = 0.05};
}

TEST(TrainingRun, Learns) {
  const TemporaryFolder folder;
  Line line;
  TrainingRun run = line.MakeRun(Options(folder, 300));
  const TrainingResult result = run.Run([&](std::int64_t) { return line.AddGradients(); });
  EXPECT_EQ(result.steps, 300);
  EXPECT_FALSE(result.interrupted);
  EXPECT_LT(result.last_loss, 0.01 * result.first_loss);
  EXPECT_NEAR(line.At(0.5), 2, 0.05);
}

TEST(TrainingRun, TakesTheAverageOfWhatIsTrained) {
  const TemporaryFolder folder;
  Line line;
  TrainingRun run = line.MakeRun(Options(folder, 10));
  run.Run([&](std::int64_t) { return line.AddGradients(); });
  const double last = line.At(0);
  run.TakeAverage();
  EXPECT_EQ(line.At(0), run.average().at("bias").item<double>());
  EXPECT_NE(line.At(0), last);
}

TEST(TrainingRun, SavesCheckpointsAsItGoes) {
  const TemporaryFolder folder;
  Line line;
  TrainingRunOptions options = Options(folder, 3);
  options.minutes_between_checkpoints = 0;
  TrainingRun run = line.MakeRun(options);
  run.Run([&](std::int64_t step) {
    EXPECT_EQ(std::filesystem::exists(folder.path() / "checkpoint.safetensors"), step > 0);
    return line.AddGradients();
  });
}

TEST(TrainingRun, GoesOnFromItsCheckpoint) {
  const TemporaryFolder folder;
  const auto train = [&](TrainingRunOptions options, bool resume) {
    options.resume = resume;
    Line line;
    TrainingRun run = line.MakeRun(options);
    const TrainingResult result = run.Run([&](std::int64_t) { return line.AddGradients(); });
    EXPECT_EQ(result.steps, options.iterations);
    return line.At(0.3);
  };
  const double stopped = train(Options(folder, 5), false);
  EXPECT_EQ(train(Options(folder, 5), true), stopped) << "the budget is used up";
  const double longer = train(Options(folder, 9), true);
  EXPECT_GT(longer, stopped);
  train(Options(folder, 5), false);
  EXPECT_EQ(train(Options(folder, 9), true), longer);
}

TEST(TrainingRun, LeavesTheNetworkAloneWhereThereIsNothingToLearn) {
  const TemporaryFolder folder;
  Line line;
  TrainingRun run = line.MakeRun(Options(folder, 4));
  int asked = 0;
  const TrainingResult result = run.Run([&](std::int64_t step) {
    EXPECT_EQ(step, asked++);
    return std::optional<double>();
  });
  EXPECT_EQ(result.steps, 4);
  EXPECT_EQ(line.At(1), 0);
}

TEST(TrainingRun, RefusesACheckpointThatDoesNotFit) {
  const TemporaryFolder folder;
  Line line;
  TrainingRunOptions options = Options(folder, 1);
  options.resume = true;
  EXPECT_THROW(line.MakeRun(options), BadFile) << "there is none";
  options.resume = false;
  line.MakeRun(options).Run([&](std::int64_t) { return line.AddGradients(); });
  options.resume = true;
  EXPECT_NO_THROW(line.MakeRun(options));
  EXPECT_THROW(line.MakeRun(options, "circle"), BadFile);
}

TEST(TrainingRun, RefusesImpossibleBudgets) {
  EXPECT_THROW(TrainingRunOptions{.minutes = 0}.Check(), InvalidOption);
  EXPECT_THROW(TrainingRunOptions{.iterations = -1}.Check(), InvalidOption);
  EXPECT_THROW(TrainingRunOptions{.learning_rate = 0}.Check(), InvalidOption);
}

}  // namespace
}  // namespace antipode
