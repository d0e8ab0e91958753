#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "antipode/evaluation/evaluation.h"
#include "antipode/pose/two_view_pose.h"

namespace antipode {

/// Which models estimate poses, as the command line names them.
struct MethodRequest {
  std::string method = "auto";
  std::string model = "prior";                 ///< of the prior: a name or a folder
  std::string matcher = "xfeat-lighterglue";
  std::string device = "auto";
  TwoViewPoseOptions options;

  /// Declares --method, --model and --matcher.
  void Declare(CLI::App& app);
};

/// Loads what the method needs; the result keeps the models alive and may be called from one thread at a time.
/// Methods: auto, prior, matching, the name of a matcher (matching with that one), MATCHER+depth-pnp,
/// MATCHER+depth-procrustes, predictions=FILE.
/// @throws InvalidOption naming the nearest method
PoseMethod LoadPoseMethod(const MethodRequest& request);

/// `request.method` may be a list, separated by commas.
std::vector<PoseMethod> LoadPoseMethods(const MethodRequest& request);

}  // namespace antipode
