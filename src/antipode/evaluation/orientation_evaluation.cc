#include "antipode/evaluation/orientation_evaluation.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "antipode/geometry/look_at.h"
#include "antipode/synthesis/mesh_synthesizer.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kWorstElevationDeg = 90, kWorstInPlaneDeg = 180;

double AngleDifferenceDeg(double a, double b) { return std::abs(std::remainder(a - b, 360)); }

/// Calls `measure` with the first views of every object; what it throws is a failure.
OrientationErrors ForEachView(const Dataset& dataset, std::size_t views_per_object, const ProgressCallback& progress,
                              const std::function<std::function<Orientation(const SceneView&)>(const std::string& object)>& estimator_of) {
  OrientationErrors errors;
  for (std::size_t i = 0; i < dataset.ObjectCount(); ++i) {
    if (progress) progress({"orientation", static_cast<std::int64_t>(i), static_cast<std::int64_t>(dataset.ObjectCount()), {}});
    const EvaluationScene scene = dataset.Load(i);
    const auto estimate = estimator_of(scene.object);
    for (std::size_t v = 0; v < std::min(views_per_object, scene.views.size()); ++v) {
      try {
        errors.Add(estimate(scene.views[v]), TrueOrientation(scene.views[v]));
      } catch (const Interrupted&) {
        throw;
      } catch (const Error&) {
        errors.AddFailure();
      }
    }
  }
  return errors;
}

}  // namespace

void OrientationErrors::Add(const Orientation& estimate, const Orientation& truth) {
  elevation.push_back(std::abs(estimate.elevation_deg - truth.elevation_deg));
  in_plane.push_back(AngleDifferenceDeg(estimate.in_plane_rotation_deg, truth.in_plane_rotation_deg));
}

void OrientationErrors::AddFailure() {
  elevation.push_back(kWorstElevationDeg);
  in_plane.push_back(kWorstInPlaneDeg);
  ++failures;
}

Orientation TrueOrientation(const SceneView& view) {
  return OrientationFromUp(view.camera_from_object.rotation.col(1));
}

OrientationErrors MeasureUprightEstimator(const Dataset& dataset, std::size_t views_per_object, const ObjectPrior& prior,
                                          const UprightEstimator& estimator, const ProgressCallback& progress) {
  return ForEachView(dataset, views_per_object, progress, [&](const std::string&) {
    return [&](const SceneView& view) {
      const ObjectPhotograph& photograph = view.photograph;
      const std::vector<ObjectView> crop{MakeObjectView(photograph.image, photograph.mask, photograph.camera, prior.ViewOptions())};
      return estimator.Estimate(prior.Encode(crop)[0]);
    };
  });
}

OrientationErrors MeasureOrientationSearch(const Dataset& dataset, std::size_t views_per_object, const std::filesystem::path& meshes,
                                           const Matcher& matcher, const OrientationSearchOptions& options,
                                           const ProgressCallback& progress) {
  return ForEachView(dataset, views_per_object, progress, [&](const std::string& object) {
    return [&, mesh = LoadMesh(meshes / (object + ".glb"))](const SceneView& view) {
      const Viewpoint viewpoint = ViewpointFromRotation(view.camera_from_object.rotation);
      return SearchOrientation(
          [&](double turn_deg) {
            MeshSynthesisOptions synthesis;
            synthesis.picture = viewpoint;
            synthesis.picture.in_plane_rotation -= turn_deg;
            return std::make_unique<MeshSynthesizer>(mesh, synthesis);
          },
          matcher, options, progress);
    };
  });
}

}  // namespace antipode
