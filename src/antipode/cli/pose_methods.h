#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "antipode/cli/synthesis_request.h"
#include "antipode/evaluation/evaluation.h"
#include "antipode/pose/two_view_pose.h"

namespace antipode {

/// Which models estimate poses, as the command line names them.
struct MethodRequest {
  std::string method = "auto";
  std::string model = "prior";                 ///< of the prior: a name or a folder
  std::string matcher;                         ///< empty: the one that suits the method, see MatcherFor
  std::string device = "auto";
  TwoViewPoseOptions options;
  bool two_way = false;                ///< also with the photographs swapped, see Reconcile
  SynthesisRequest synthesis;          ///< for "diffusion"
  ViewComparisonRequest comparison;
  /// Folder of data set objects that are their own meshes: for "diffusion" with the synthesiser "mesh".
  std::filesystem::path object_meshes;
  ProgressCallback progress = {};      ///< of making views

  /// What the user chose, else what suits a method: "auto" weighs matches by the prior, so that a matcher which finds more of
  /// them from far apart serves it best.
  std::string MatcherFor(const std::string& method_name) const;

  /// Declares --method, --model, --matcher, --two-way and the options of the synthesis.
  void Declare(CLI::App& app);
};

/// Loads what the method needs; the result keeps the models alive and may be called from one thread at a time.
/// Methods: auto, prior, matching, diffusion, the name of a matcher (matching with that one), MATCHER+depth-pnp,
/// MATCHER+depth-procrustes, predictions=FILE.
/// @throws InvalidOption naming the nearest method
PoseMethod LoadPoseMethod(const MethodRequest& request);

/// `request.method` may be a list, separated by commas.
std::vector<PoseMethod> LoadPoseMethods(const MethodRequest& request);

/// The route "diffusion" with 8 to 128 views ("views") or 0 to 3 refinement steps ("iterations").
/// @throws InvalidOption if it is neither, or there is no refiner to iterate
std::vector<PoseMethod> LoadSweep(const MethodRequest& request, const std::string& what);

}  // namespace antipode
