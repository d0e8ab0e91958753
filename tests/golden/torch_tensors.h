#pragma once

#include <map>
#include <string>

#include <torch/torch.h>

#include "antipode/nn/observation.h"
#include "manifest.h"
#include "numeric_tensor.h"

namespace antipode::golden {

NumericTensor FromTorchTensor(const torch::Tensor& tensor);

/// A stored tensor, float64.
torch::Tensor StoredTensor(const GoldenCase& golden_case, const std::string& name);

/// The generated input `key` of a case: in one format an object entry, {"name", "shape", "kind"}: "unit" (variance 1), "plain ..." (in -1..1), either
/// followed by ", then multiplied by X". `step` replaces "{k}" in the name. In the other format
/// a list entry whose name ends in ".key", {"name", "shape", "range"}: "01", "sqrt3" or "smooth".
torch::Tensor GeneratedTensor(const GoldenCase& golden_case, const std::string& key, int step = 0);

/// What of a tensor the text "[:,::2,:4,1:9:2] .." keeps: start, end and step of each axis.
torch::Tensor Sliced(torch::Tensor tensor, const std::string& slices);

/// Keeps what a network shows, if the case lists it, cut as the case says.
class Recorder {
 public:
  explicit Recorder(const GoldenCase& golden_case) : case_(golden_case) {}

  Observation Look();
  void Add(const std::string& name, const torch::Tensor& tensor);
  NumericTensors Take() { return std::move(recorded_); }

 private:
  const GoldenCase& case_;
  NumericTensors recorded_;
};

}  // namespace antipode::golden
