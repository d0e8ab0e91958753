#pragma once

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "antipode/pose/two_view_pose.h"

namespace antipode {

/// What the command line says about one photograph.
struct PhotographRequest {
  std::string path;
  std::optional<std::string> mask, box, camera, depth;
  std::optional<double> depth_unit;

  /// Declares the positional argument and --ROLE-mask, --ROLE-box, --ROLE-camera, --ROLE-depth, --ROLE-depth-unit.
  /// @param role "reference" or "query"
  void Declare(CLI::App& app, const std::string& role);
};

struct PhotographInput {
  ObjectPhotograph photograph;
  std::string path, mask_source, camera_source;
  std::vector<std::string> warnings;
};

/// Reads the picture, finds the object's mask and the camera.
/// @throws Error naming the file or the option at fault
PhotographInput LoadPhotograph(const PhotographRequest& request, const std::string& role);

/// Without a picture the path is that of a reference folder.
nlohmann::ordered_json ToJson(const PhotographInput& input);

/// One line: size, camera and mask, and where they are known from.
std::string Describe(const PhotographInput& input);

}  // namespace antipode
