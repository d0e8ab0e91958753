#include "antipode/cli/photograph_input.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include "antipode/geometry/rotation.h"
#include "antipode/image/camera_spec.h"
#include "antipode/image/load.h"
#include "antipode/image/mask.h"
#include "antipode/matching/depth_pose.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

cv::Rect ParseBox(const std::string& text, const std::string& option) {
  std::vector<int> values;
  std::istringstream items(text);
  for (std::string item; std::getline(items, item, ',');) {
    int value = 0;
    const auto [end, error] = std::from_chars(item.data(), item.data() + item.size(), value);
    if (error != std::errc() || end != item.data() + item.size()) break;
    values.push_back(value);
  }
  const bool is_complete = values.size() == 4 && std::ranges::count(text, ',') == 3;
  if (!is_complete)
    throw InvalidOption(option, Quoted(text) + " is not a box", "give x,y,width,height in whole pixels");
  return {values[0], values[1], values[2], values[3]};
}

MaskRequest ToMaskRequest(const PhotographRequest& request, const std::string& role) {
  MaskRequest result;
  if (request.mask) result.file = *request.mask;
  if (request.box) result.box = ParseBox(*request.box, "--" + role + "-box");
  return result;
}

double FieldOfViewDeg(const PinholeCamera& camera) {
  const bool is_wide = camera.width >= camera.height;
  const double half = is_wide ? 0.5 * camera.width / camera.fx : 0.5 * camera.height / camera.fy;
  return 2 * DegreesFromRadians(std::atan(half));
}

/// Lower layers name a field without knowing which picture is meant: say it in the option's words.
template <typename Function>
auto WithOptionName(const std::string& option, const std::string& field, const Function& function) {
  try {
    return function();
  } catch (const InvalidOption& error) {
    std::string problem = error.what();
    if (problem.starts_with(field + ": ")) problem.erase(0, field.size() + 2);
    throw InvalidOption(option, problem);
  }
}

std::string MaskSourceText(const std::string& source) {
  if (source == "file") return "mask given";
  if (source == "alpha") return "mask from the alpha channel";
  if (source == "box") return "mask found inside the box";
  return "mask found on the uniform background";
}

}  // namespace

void PhotographRequest::Declare(CLI::App& app, const std::string& role) {
  std::string name = role;
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::toupper(c); });
  const std::string group = "The " + role + " picture";
  app.add_option(name, path, "The " + role + " picture")->required()->type_name("FILE");
  app.add_option("--" + role + "-mask", mask,
                 "Which pixels are the object: a picture of the same size, white on black")
      ->type_name("FILE")->group(group);
  app.add_option("--" + role + "-box", box, "Or a box around the object, in pixels")
      ->type_name("x,y,w,h")->group(group);
  app.add_option("--" + role + "-camera", camera,
                 "fov=DEGREES, f=PIXELS, fx,fy,cx,cy, or a JSON or COLMAP cameras.txt file; "
                 "without: EXIF, else 50 degrees")
      ->type_name("CAMERA")->group(group);
  CLI::Option* depth_option =
      app.add_option("--" + role + "-depth", depth,
                     "Depths along the optical axis, for the methods with +depth-: a 16-bit PNG in millimetres, or a "
                     "float32 TIFF in metres; 0 where unknown")
          ->type_name("FILE")->group(group);
  app.add_option("--" + role + "-depth-unit", depth_unit, "Other unit of these depths, in metres")
      ->type_name("METRES")->needs(depth_option)->group(group);
}

PhotographInput LoadPhotograph(const PhotographRequest& request, const std::string& role) {
  const LoadedImage image = LoadImage(request.path);
  const SourcedCamera camera = WithOptionName("--" + role + "-camera", "camera", [&] {
    return ResolveCamera(request.camera, image.rgb.cols, image.rgb.rows, image.exif_focal_px);
  });
  const MaskRequest mask_request = ToMaskRequest(request, role);
  const ObjectMask mask = WithOptionName("--" + role + "-box", "box", [&] {
    return FindObjectMask(image, mask_request, request.path);
  });
  PhotographInput input{{image.rgb, mask.mask, camera.camera}, request.path, mask.source, camera.source, {}};
  if (request.depth) {
    input.photograph.depth = WithOptionName("--" + role + "-depth-unit", "depth unit", [&] {
      return LoadDepth(*request.depth, image.rgb.size(), request.depth_unit);
    });
  }
  for (const std::string& warning : mask.warnings) input.warnings.push_back(role + ": " + warning);
  if (camera.source == "assumed") {
    input.warnings.push_back(role + ": the camera is not known, a field of view of 50 degrees is assumed; " +
                             "give --" + role + "-camera");
  }
  return input;
}

nlohmann::ordered_json ToJson(const PhotographInput& input) {
  if (input.photograph.image.empty()) return {{"path", input.path}};
  const PinholeCamera& camera = input.photograph.camera;
  return {{"path", input.path},
          {"camera",
           {{"fx", camera.fx},
            {"fy", camera.fy},
            {"cx", camera.cx},
            {"cy", camera.cy},
            {"width", camera.width},
            {"height", camera.height},
            {"source", input.camera_source}}},
          {"mask", {{"source", input.mask_source}}}};
}

std::string Describe(const PhotographInput& input) {
  if (input.photograph.image.empty()) return input.path + ": posed views";
  const PinholeCamera& camera = input.photograph.camera;
  return Formatted("%s: %d x %d pixels, field of view %.0f degrees (%s), %s", input.path.c_str(), camera.width,
                   camera.height, FieldOfViewDeg(camera), input.camera_source.c_str(),
                   MaskSourceText(input.mask_source).c_str());
}

}  // namespace antipode
