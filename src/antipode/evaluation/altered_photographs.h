#pragma once

#include <functional>
#include <memory>
#include <random>
#include <string>

#include "antipode/evaluation/dataset.h"

namespace antipode {

/// A data set whose photographs are altered as they are loaded.
class AlteredPhotographs : public Dataset {
 public:
  /// Alters one photograph; `random` depends on the scene's and the view's number alone.
  using Alter = std::function<void(ObjectPhotograph& photograph, std::mt19937_64& random)>;

  AlteredPhotographs(std::unique_ptr<Dataset> dataset, Alter alter);

  std::string Name() const override { return dataset_->Name(); }
  std::size_t ObjectCount() const override { return dataset_->ObjectCount(); }
  std::size_t PairCount() const override { return dataset_->PairCount(); }
  EvaluationScene Load(std::size_t index) const override;

 private:
  std::unique_ptr<Dataset> dataset_;
  Alter alter_;
};

}  // namespace antipode
