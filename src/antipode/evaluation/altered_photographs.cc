#include "antipode/evaluation/altered_photographs.h"

#include <utility>

#include "antipode/util/seeds.h"

namespace antipode {

AlteredPhotographs::AlteredPhotographs(std::unique_ptr<Dataset> dataset, Alter alter) : dataset_(std::move(dataset)), alter_(std::move(alter)) {}

EvaluationScene AlteredPhotographs::Load(std::size_t index) const {
  EvaluationScene scene = dataset_->Load(index);
  for (std::size_t view = 0; view < scene.views.size(); ++view) {
    std::mt19937_64 random(CombineSeeds(index, view));
    alter_(scene.views[view].photograph, random);
  }
  return scene;
}

}  // namespace antipode
