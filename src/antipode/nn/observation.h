#pragma once

#include <functional>
#include <string>
#include <utility>

#include <torch/torch.h>

namespace antipode {

/// Shows somebody the outputs of a network's parts by the name of the part, as in the checkpoint's keys. Without
/// anybody looking it costs nothing.
class Observation {
 public:
  using Observer = std::function<void(const std::string& name, const torch::Tensor& output)>;

  Observation() = default;
  explicit Observation(Observer observer) : observer_(std::move(observer)) {}

  void Show(const std::string& name, const torch::Tensor& output) const {
    if (observer_) observer_(name, output);
  }
  /// Of the parts of the part `name`.
  Observation Inside(const std::string& name) const {
    if (!observer_) return {};
    return Observation([observer = observer_, prefix = name + "."](const std::string& inner, const torch::Tensor& output) {
      observer(prefix + inner, output);
    });
  }

 private:
  Observer observer_;
};

}  // namespace antipode
