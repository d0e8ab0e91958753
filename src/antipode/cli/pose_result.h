#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "antipode/cli/photograph_input.h"
#include "antipode/pose/two_view_pose.h"

namespace antipode {

/// Everything `antipode pose` tells.
struct PoseResult {
  std::string method, model;
  PhotographInput reference, query;
  TwoViewPose pose;
  std::optional<double> object_size;  ///< diameter, metres
  double load_seconds = 0;            ///< from the start of the process to the first computation
  double total_seconds = 0;

  /// Those of the pictures, then those of the pose, each once.
  std::vector<std::string> Warnings() const;
};

nlohmann::ordered_json ToJson(const PoseResult& result);
std::string ToText(const PoseResult& result);

}  // namespace antipode
