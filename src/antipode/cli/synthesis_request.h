#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "antipode/orientation/orientation.h"
#include "antipode/pose/reference_build.h"
#include "antipode/pose/two_view_pose.h"
#include "antipode/pose/view_comparison.h"
#include "antipode/zero123/zero123.h"

namespace antipode {

/// "fast" or "paper": exactly as the paper's program samples. @throws InvalidOption naming --preset
Zero123Options SamplingPreset(const std::string& name);

/// "float32", "bfloat16", or "auto": bfloat16 for the preset fast where the processor multiplies it in hardware.
/// @throws InvalidOption naming --precision
DenoiserPrecision PrecisionOf(const std::string& name, const std::string& preset);

/// The model that imagines: for "auto" Zero123 where it was imported, else the built-in volume. @throws Error if the model named
/// zero123 is not installed
std::string ChosenSynthesisModel(const std::string& name);

/// To say of views by the built-in volume that were not asked of it; otherwise nothing.
/// @param name as for ChosenSynthesisModel
std::optional<std::string> WarningOfCoarseViews(const std::string& name);

/// Where the views of an object come from, as the command line names it.
struct SynthesisRequest {
  std::string synthesizer = "diffusion";   ///< or "mesh"
  std::string mesh;                        ///< file, for "mesh"
  std::string model = "auto";              ///< see ChosenSynthesisModel
  std::string preset = "fast";
  std::string precision = "auto";
  int views = 64, batch = 4;
  double memory_limit_gb = 0;  ///< 0: none
  std::optional<double> elevation_deg, in_plane_rotation_deg;  ///< of the photograph; without: estimated
  std::uint64_t seed = 1;
  std::string device = "auto";

  /// Declares --synthesizer, --mesh, --synthesis-model, --preset, --precision, --views, --batch, --memory-limit, --elevation, --in-plane-rotation.
  /// @param views_option what --views is called, where that means something else
  void Declare(CLI::App& app, const std::string& group = {}, const std::string& views_option = "--views");
  /// @throws InvalidOption if options are missing or do not fit together
  void Check() const;
  bool IsMesh() const { return synthesizer == "mesh"; }
};

/// Which of Gen6D's networks look at the views.
struct ViewComparisonRequest {
  std::string selector;             ///< model; empty: without
  std::string refiner = "refiner";  ///< model; "none": without
  int refine_iterations = 3;

  /// Declares --selector, --refiner, --refine-iterations.
  void Declare(CLI::App& app, const std::string& group);
  bool Refines() const { return refiner != "none"; }
  bool IsWanted() const { return !selector.empty() || Refines(); }
  ViewComparison Load(torch::Device device) const { return ViewComparison::Load(selector, Refines() ? refiner : "", device); }
};

/// The prior with what else references need.
struct ReferenceModels {
  std::shared_ptr<const ObjectPrior> prior;
  PriorIdentity identity;
  std::optional<UprightEstimator> upright;  ///< nothing if it is not installed or belongs to another prior

  static ReferenceModels Load(const std::string& prior, const std::string& device);
};

/// How a photograph stands, from what is given and what the code says.
struct PhotographOrientation {
  Orientation orientation;
  std::vector<std::string> warnings;  ///< what was assumed or is uncertain
};
PhotographOrientation OrientPhotograph(const SynthesisRequest& request, const ReferenceModels& models, const ObjectPhotograph& photograph);

/// Imagines the object of a photograph that is first turned counter-clockwise.
std::unique_ptr<ViewSynthesizer> SynthesizerOf(const SynthesisRequest& request, const ObjectPhotograph& photograph, double turn_deg);

/// The reference of a photograph or, for a mesh, of the mesh alone.
/// @param photograph not null unless the views come from a mesh
/// @param folder see BuildReference
Reference BuildReference(const SynthesisRequest& request, const ReferenceModels& models, const ObjectPhotograph* photograph,
                         const std::filesystem::path& folder, const ProgressCallback& progress);

/// The reference of a mesh, all sides.
Reference BuildMeshReference(const std::filesystem::path& mesh, int views, const ReferenceModels& models,
                             const std::filesystem::path& folder = {}, const ProgressCallback& progress = {});

}  // namespace antipode
