#include "antipode/image/camera_spec.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>
#include <vector>

#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

constexpr double kAssumedFieldOfViewDeg = 50;
/// A skew below this share of the focal length is rounding.
constexpr double kMaxSkew = 1e-6;
constexpr char kForms[] =
    "give fov=DEGREES, f=PIXELS, fx,fy,cx,cy, or a COLMAP cameras.txt or JSON file";

std::optional<double> ParseNumber(std::string_view text) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// The numbers of "a,b,c", or nothing if one of them is no number.
std::optional<std::vector<double>> ParseList(const std::string& text) {
  std::vector<double> values;
  std::istringstream stream(text);
  for (std::string item; std::getline(stream, item, ',');) {
    const std::optional<double> value = ParseNumber(item);
    if (!value) return std::nullopt;
    values.push_back(*value);
  }
  return values;
}

PinholeCamera WithFocalLength(int width, int height, double focal_length) {
  return {width, height, focal_length, focal_length, 0.5 * width, 0.5 * height};
}

PinholeCamera FromValue(std::string_view key, const std::string& value, int width, int height) {
  const std::optional<double> number = ParseNumber(value);
  if (!number) throw InvalidOption("camera", Quoted(value) + " is not a number", kForms);
  if (key == "fov") return PinholeCamera::FromFieldOfView(width, height, *number);
  return WithFocalLength(width, height, *number);
}

void CheckImageSize(const std::string& subject, const PinholeCamera& camera, int width,
                    int height) {
  if (camera.width == width && camera.height == height) return;
  throw BadFile(subject,
                "holds a camera for " + std::to_string(camera.width) + " x " +
                    std::to_string(camera.height) + " pixels, the image has " +
                    std::to_string(width) + " x " + std::to_string(height),
                "give the camera of this image");
}

int ReadSide(const std::string& subject, const nlohmann::json& json, const char* key,
             int otherwise) {
  if (!json.contains(key)) return otherwise;
  if (!json[key].is_number_integer())
    throw BadFile(subject, std::string(key) + " is not a whole number");
  const auto value = json[key].get<std::int64_t>();
  if (value <= 0 || value > 1 << 30)
    throw BadFile(subject, std::string(key) + " is not a possible size");
  return static_cast<int>(value);
}

double ReadNumber(const std::string& subject, const nlohmann::json& value, const char* name) {
  if (!value.is_number())
    throw BadFile(subject, std::string(name) + " is missing or not a number", kForms);
  return value.get<double>();
}

/// Three rows of three, or nine numbers row by row.
std::vector<double> ReadMatrix(const std::string& subject, const nlohmann::json& json) {
  std::vector<double> values;
  const auto append = [&](const nlohmann::json& row) {
    for (const nlohmann::json& value : row)
      values.push_back(ReadNumber(subject, value, "an element of K"));
  };
  if (json.is_array() && json.size() == 3) {
    for (const nlohmann::json& row : json)
      append(row.is_array() && row.size() == 3 ? row : nlohmann::json());
  } else if (json.is_array() && json.size() == 9) {
    append(json);
  }
  if (values.size() != 9)
    throw BadFile(subject, "K is not a 3 x 3 matrix", "give [[fx,0,cx],[0,fy,cy],[0,0,1]]");
  return values;
}

PinholeCamera FromMatrix(const std::string& subject, const nlohmann::json& json) {
  const std::vector<double> k = ReadMatrix(subject, json);
  const bool is_pinhole = std::abs(k[1]) <= kMaxSkew * std::abs(k[0]) && k[3] == 0 && k[6] == 0 &&
                          k[7] == 0 && k[8] == 1;
  if (!is_pinhole) {
    throw BadFile(subject, "K has skew or another last row than 0 0 1",
                  "give [[fx,0,cx],[0,fy,cy],[0,0,1]] of an undistorted picture");
  }
  return {0, 0, k[0], k[4], k[2], k[5]};
}

PinholeCamera FromJson(const std::string& subject, const std::string& text, int width, int height) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) throw BadFile(subject, "is not a JSON object", kForms);
  PinholeCamera camera;
  if (json.contains("K")) {
    camera = FromMatrix(subject, json["K"]);
  } else {
    const auto number = [&](const char* key) {
      return ReadNumber(subject, json.contains(key) ? json[key] : nlohmann::json(), key);
    };
    camera = {0, 0, number("fx"), number("fy"), number("cx"), number("cy")};
  }
  camera.width = ReadSide(subject, json, "width", width);
  camera.height = ReadSide(subject, json, "height", height);
  return camera;
}

/// Model and parameters of one line of cameras.txt; pixel edges at integers, as here.
PinholeCamera FromColmapModel(const std::string& subject, const std::string& model,
                              const std::vector<double>& p) {
  if (model == "SIMPLE_PINHOLE" && p.size() == 3) return {0, 0, p[0], p[0], p[1], p[2]};
  if (model == "PINHOLE" && p.size() == 4) return {0, 0, p[0], p[1], p[2], p[3]};
  if (model == "SIMPLE_PINHOLE" || model == "PINHOLE") {
    throw BadFile(subject,
                  "has " + std::to_string(p.size()) + " parameters for a " + model + " camera",
                  "SIMPLE_PINHOLE has f cx cy, PINHOLE has fx fy cx cy");
  }
  constexpr std::string_view kDistorted[] = {"SIMPLE_RADIAL",
                                             "RADIAL",
                                             "OPENCV",
                                             "OPENCV_FISHEYE",
                                             "FULL_OPENCV",
                                             "FOV",
                                             "THIN_PRISM_FISHEYE",
                                             "SIMPLE_RADIAL_FISHEYE",
                                             "RADIAL_FISHEYE",
                                             "RAD_TAN_THIN_PRISM_FISHEYE"};
  if (std::ranges::find(kDistorted, model) != std::end(kDistorted)) {
    throw BadFile(
        subject, "has a camera of model " + model + ", which has lens distortion",
        "undistort the pictures first (colmap image_undistorter) and give their PINHOLE camera");
  }
  throw BadFile(subject, "has a camera of unknown model " + Quoted(model),
                "use PINHOLE or SIMPLE_PINHOLE");
}

/// One line of cameras.txt: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[].
PinholeCamera FromColmapLine(const std::string& subject, const std::string& line) {
  std::istringstream words(line);
  std::string id, model;
  words >> id >> model;
  std::vector<double> numbers;
  for (std::string word; words >> word;) numbers.push_back(ParseNumber(word).value_or(NAN));
  const auto is_side = [](double value) { return value >= 1 && value <= 1 << 30; };
  if (numbers.size() < 2 || !is_side(numbers[0]) || !is_side(numbers[1])) {
    throw BadFile(subject, Quoted(line) + " is not a line CAMERA_ID MODEL WIDTH HEIGHT PARAMS",
                  kForms);
  }
  PinholeCamera camera = FromColmapModel(subject, model, {numbers.begin() + 2, numbers.end()});
  camera.width = static_cast<int>(numbers[0]);
  camera.height = static_cast<int>(numbers[1]);
  return camera;
}

bool IsSame(const PinholeCamera& a, const PinholeCamera& b) {
  return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy;
}

/// The only camera, or the only one for this image size.
PinholeCamera FromColmap(const std::string& subject, const std::string& text, int width,
                         int height) {
  std::vector<PinholeCamera> cameras, fitting;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    cameras.push_back(FromColmapLine(subject, line));
    if (cameras.back().width == width && cameras.back().height == height)
      fitting.push_back(cameras.back());
  }
  if (cameras.empty()) throw BadFile(subject, "holds no camera", kForms);
  if (fitting.empty()) return cameras.front();
  const bool is_ambiguous = !std::ranges::all_of(
      fitting, [&](const PinholeCamera& other) { return IsSame(other, fitting.front()); });
  if (is_ambiguous) {
    throw BadFile(subject, "holds several different cameras of this image size",
                  "give fx,fy,cx,cy");
  }
  return fitting.front();
}

PinholeCamera FromFile(const std::string& path, int width, int height) {
  const std::string text = ReadFile(path);
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) throw BadFile(path, "is empty", kForms);
  const bool is_json = text[first] == '{' || text[first] == '[';
  const PinholeCamera camera =
      is_json ? FromJson(path, text, width, height) : FromColmap(path, text, width, height);
  CheckImageSize(path, camera, width, height);
  try {
    camera.Check();
  } catch (const InvalidOption& error) {
    throw BadFile(path, error.what());
  }
  return camera;
}

PinholeCamera FromText(const std::string& text, int width, int height) {
  const std::size_t equals = text.find('=');
  const std::string key = text.substr(0, equals);
  if (equals != std::string::npos && (key == "fov" || key == "f")) {
    return FromValue(key, text.substr(equals + 1), width, height);
  }
  if (const auto values = ParseList(text)) {
    if (values->size() == 4)
      return {width, height, (*values)[0], (*values)[1], (*values)[2], (*values)[3]};
    throw InvalidOption("camera",
                        Quoted(text) + " has " + std::to_string(values->size()) + " numbers, not 4",
                        kForms);
  }
  std::error_code ignored;
  if (!std::filesystem::exists(text, ignored)) {
    throw InvalidOption("camera", Quoted(text) + " is neither a camera nor an existing file",
                        kForms);
  }
  return FromFile(text, width, height);
}

}  // namespace

SourcedCamera ResolveCamera(const std::optional<std::string>& spec, int width, int height,
                            std::optional<double> exif_focal_px) {
  if (spec) {
    const PinholeCamera camera = FromText(*spec, width, height);
    camera.Check();
    return {camera, "given"};
  }
  if (exif_focal_px && std::isfinite(*exif_focal_px) && *exif_focal_px > 0) {
    return {WithFocalLength(width, height, *exif_focal_px), "exif"};
  }
  return {PinholeCamera::FromFieldOfView(width, height, kAssumedFieldOfViewDeg), "assumed"};
}

}  // namespace antipode
