#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "antipode/evaluation/dataset.h"
#include "antipode/orientation/orientation.h"
#include "antipode/prior/object_prior.h"
#include "antipode/util/progress.h"

namespace antipode {

/// How far an estimate is from the truth, degrees.
struct OrientationErrors {
  std::vector<double> elevation, in_plane;
  int failures = 0;  ///< errors of 90 and 180 degrees

  void Add(const Orientation& estimate, const Orientation& truth);
  void AddFailure();
};

/// The true orientation of a data set view whose object's frame has +Y up.
Orientation TrueOrientation(const SceneView& view);

/// The estimate from the code, on the first `views_per_object` views of every object.
OrientationErrors MeasureUprightEstimator(const Dataset& dataset, std::size_t views_per_object, const ObjectPrior& prior,
                                          const UprightEstimator& estimator, const ProgressCallback& progress = {});

/// The search with the object's own mesh as the synthesiser, which keeps the picture's in-plane rotation.
/// @param meshes folder with OBJECT.glb
OrientationErrors MeasureOrientationSearch(const Dataset& dataset, std::size_t views_per_object, const std::filesystem::path& meshes,
                                           const Matcher& matcher, const OrientationSearchOptions& options,
                                           const ProgressCallback& progress = {});

}  // namespace antipode
