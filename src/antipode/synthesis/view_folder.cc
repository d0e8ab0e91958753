#include "antipode/synthesis/view_folder.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include <nlohmann/json.hpp>

#include "antipode/geometry/rotation.h"
#include "antipode/image/load.h"
#include "antipode/synthesis/pose_json.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/version.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kListFile[] = "views.json";

Json Rows(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    rows.push_back(Json::array());
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) rows.back().push_back(matrix(r, c));
  }
  return rows;
}

Eigen::Matrix4d MatrixOf(const Rigid3& pose) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = pose.rotation;
  matrix.topRightCorner<3, 1>() = pose.translation;
  return matrix;
}

std::string FileOf(const std::string& name) { return name + ".png"; }

Json ViewJson(const SynthesizedView& view, const std::string& sha256) {
  const PinholeCamera& camera = view.camera;
  return {{"name", view.request.name},
          {"file", FileOf(view.request.name)},
          {"sha256", sha256},
          {"elevation_deg", DegreesFromRadians(view.request.direction.elevation)},
          {"azimuth_deg", DegreesFromRadians(view.request.direction.azimuth)},
          {"camera", {{"fx", camera.fx}, {"fy", camera.fy}, {"cx", camera.cx}, {"cy", camera.cy}, {"width", camera.width},
                      {"height", camera.height}}},
          {"camera_from_object", PoseToJson(view.camera_from_object)}};
}

PinholeCamera CameraFrom(const Json& json) {
  return {json.at("width"), json.at("height"), json.at("fx"), json.at("fy"), json.at("cx"), json.at("cy")};
}

/// x right, y up, z backward, in a world with +Z up, as NeRF tools have it.
Eigen::Matrix4d NerfPose(const SynthesizedView& view) {
  Rigid3 world_from_camera = view.camera_from_object.Inverse();
  world_from_camera.rotation = CanonicalFromObjectRotation() * world_from_camera.rotation;
  world_from_camera.translation = CanonicalFromObjectRotation() * world_from_camera.translation;
  Eigen::Matrix4d matrix = MatrixOf(world_from_camera);
  matrix.col(1) *= -1;
  matrix.col(2) *= -1;
  return matrix;
}

std::string TransformsJson(const std::vector<SynthesizedView>& views) {
  const PinholeCamera& camera = views.front().camera;
  Json json = {{"camera_angle_x", 2 * std::atan(0.5 * camera.width / camera.fx)}, {"fl_x", camera.fx}, {"fl_y", camera.fy},
               {"cx", camera.cx}, {"cy", camera.cy}, {"w", camera.width}, {"h", camera.height}, {"frames", Json::array()}};
  for (const SynthesizedView& view : views)
    json["frames"].push_back({{"file_path", FileOf(view.request.name)}, {"transform_matrix", Rows(NerfPose(view))}});
  return json.dump(2) + "\n";
}

std::string ColmapCameras(const PinholeCamera& camera) {
  std::ostringstream text;
  text.precision(17);
  text << "# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy\n1 PINHOLE " << camera.width << ' ' << camera.height << ' ' << camera.fx
       << ' ' << camera.fy << ' ' << camera.cx << ' ' << camera.cy << "\n";
  return text.str();
}

std::string ColmapImages(const std::vector<SynthesizedView>& views) {
  std::ostringstream text;
  text.precision(17);
  text << "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then an empty line\n";
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Eigen::Vector4d q = QuaternionWxyz(views[i].camera_from_object.rotation);
    text << i + 1;
    for (const double value : q) text << ' ' << value;
    for (const double value : views[i].camera_from_object.translation) text << ' ' << value;
    text << " 1 " << FileOf(views[i].request.name) << "\n\n";
  }
  return text.str();
}

}  // namespace

ViewFolder::ViewFolder(fs::path folder) : folder_(std::move(folder)) {
  const fs::path list = folder_ / kListFile;
  try {
    const Json json = Json::parse(ReadFile(list));
    fingerprint_ = json.at("fingerprint");
    for (const Json& view : json.at("views")) entries_.push_back({view.at("name"), view.at("sha256"), view.dump()});
  } catch (const Json::exception&) {
    throw BadFile(list.string(), "is damaged", "remove it; all views will be made again");
  }
}

ViewFolder::ViewFolder(const fs::path& folder, const std::string& fingerprint) {
  if (fs::exists(folder / kListFile)) {
    *this = ViewFolder(folder);
    if (fingerprint_ != fingerprint)
      throw Error(folder.string(), "holds views of another picture, model or other settings", "choose an empty folder");
  }
  folder_ = folder;
  fingerprint_ = fingerprint;
}

std::optional<SynthesizedView> ViewFolder::Find(const ViewRequest& request) const {
  const auto entry = std::ranges::find(entries_, request.name, &Entry::name);
  if (entry == entries_.end() || !IsIntact(*entry)) return std::nullopt;
  SynthesizedView view = Read(*entry);
  view.request = request;
  return view;
}

bool ViewFolder::IsIntact(const Entry& entry) const {
  const fs::path file = folder_ / FileOf(entry.name);
  return fs::exists(file) && Sha256OfFile(file) == entry.sha256;
}

SynthesizedView ViewFolder::Read(const Entry& entry) const {
  try {
    const Json json = Json::parse(entry.json);
    ViewRequest request;
    request.name = entry.name;
    request.direction = {RadiansFromDegrees(json.at("elevation_deg")), RadiansFromDegrees(json.at("azimuth_deg"))};
    return {request, LoadImage((folder_ / FileOf(entry.name)).string()).rgb, CameraFrom(json.at("camera")),
            PoseFromJson(json.at("camera_from_object"))};
  } catch (const Json::exception&) {
    throw BadFile((folder_ / kListFile).string(), "is damaged", "remove it; all views will be made again");
  }
}

std::vector<SynthesizedView> ViewFolder::LoadAll(const fs::path& folder) {
  const fs::path list = folder / kListFile;
  if (!fs::exists(list)) throw BadFile(list.string(), "is missing", "build the folder again");
  const ViewFolder files(folder);
  std::vector<SynthesizedView> views;
  for (const Entry& entry : files.entries_) {
    if (!files.IsIntact(entry))
      throw BadFile((folder / FileOf(entry.name)).string(), "is missing or not what was written", "build the folder again");
    views.push_back(files.Read(entry));
  }
  return views;
}

void ViewFolder::Add(const SynthesizedView& view) {
  const fs::path file = folder_ / FileOf(view.request.name);
  SaveImage(file, view.image);
  const std::string sha256 = Sha256OfFile(file);
  std::erase_if(entries_, [&](const Entry& entry) { return entry.name == view.request.name; });
  entries_.push_back({view.request.name, sha256, ViewJson(view, sha256).dump()});
  WriteList();
}

void ViewFolder::WriteList() const {
  Json views = Json::array();
  for (const Entry& entry : entries_) views.push_back(Json::parse(entry.json));
  const Json json = {{"antipode", Version()}, {"fingerprint", fingerprint_}, {"length_unit", "object radius"}, {"views", views}};
  WriteFileAtomically(folder_ / kListFile, json.dump(2) + "\n");
}

void ViewFolder::WriteOverviews(const std::vector<SynthesizedView>& views) const {
  SaveImage(folder_ / "contact_sheet.png", ContactSheet(views));
  WriteFileAtomically(folder_ / "transforms.json", TransformsJson(views));
  WriteFileAtomically(folder_ / "colmap" / "cameras.txt", ColmapCameras(views.front().camera));
  WriteFileAtomically(folder_ / "colmap" / "images.txt", ColmapImages(views));
  WriteFileAtomically(folder_ / "colmap" / "points3D.txt", "# no points\n");
}

cv::Mat ContactSheet(const std::vector<SynthesizedView>& views) {
  if (views.empty()) throw Error("contact sheet", "has no views");
  const cv::Size cell = views.front().image.size();
  const auto columns = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(views.size()))));
  const int rows = (static_cast<int>(views.size()) + columns - 1) / columns;
  cv::Mat sheet(rows * cell.height, columns * cell.width, CV_8UC3, cv::Scalar::all(255));
  for (int i = 0; i < static_cast<int>(views.size()); ++i)
    views[static_cast<std::size_t>(i)].image.copyTo(
        sheet(cv::Rect({i % columns * cell.width, i / columns * cell.height}, cell)));
  return sheet;
}

std::vector<SynthesizedView> FindOrMakeViews(const ViewSynthesizer& synthesizer, std::span<const ViewRequest> requests,
                                             ViewFolder& folder, const ProgressCallback& progress) {
  std::map<std::string, SynthesizedView> views;
  std::vector<ViewRequest> missing;
  for (const ViewRequest& request : requests) {
    if (auto view = folder.Find(request)) {
      views[request.name] = std::move(*view);
    } else {
      missing.push_back(request);
    }
  }
  const auto keep = [&](const SynthesizedView& view) {
    folder.Add(view);
    views[view.request.name] = view;
  };
  synthesizer.Synthesize(missing, keep, progress);
  std::vector<SynthesizedView> in_order;
  for (const ViewRequest& request : requests) in_order.push_back(views.at(request.name));
  return in_order;
}

}  // namespace antipode
