#pragma once

#include <memory>

#include "antipode/evaluation/dataset.h"

namespace antipode {

/// A data set with imprecise masks: each dilated once by a square of trunc(share min(width, height)) pixels of its picture (the
/// paper's test with 2, 5 and 10 percent).
class DilatedMasks : public Dataset {
 public:
  /// @param share 0..0.5 @throws InvalidOption
  DilatedMasks(std::unique_ptr<Dataset> dataset, double share);

  std::string Name() const override { return dataset_->Name(); }
  std::size_t ObjectCount() const override { return dataset_->ObjectCount(); }
  std::size_t PairCount() const override { return dataset_->PairCount(); }
  EvaluationScene Load(std::size_t index) const override;

 private:
  std::unique_ptr<Dataset> dataset_;
  double share_;
};

}  // namespace antipode
