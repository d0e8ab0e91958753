#include <algorithm>
#include <cmath>
#include <optional>
#include <system_error>
#include <utility>

#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "antipode/evaluation/dataset.h"
#include "antipode/evaluation/json_file.h"
#include "antipode/geometry/rotation.h"
#include "antipode/image/load.h"
#include "antipode/image/mask.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr char kCameras[] = "cameras.json";
constexpr double kRotationTolerance = 1e-3;

/// A part of a camera file that knows where it is, for messages.
class Field {
 public:
  Field(const fs::path& file, std::string name, const nlohmann::json& value)
      : file_(file), name_(std::move(name)), value_(value) {}

  Field At(const std::string& key) const {
    const std::string name = name_.empty() ? key : name_ + "." + key;
    if (!value_.is_object()) Fail("is not an object");
    const auto found = value_.find(key);
    if (found == value_.end()) Field(file_, name, value_).Fail("is missing");
    return {file_, name, *found};
  }
  bool Has(const std::string& key) const { return value_.is_object() && value_.contains(key); }

  std::vector<Field> List() const {
    if (!value_.is_array()) Fail("is not a list");
    std::vector<Field> items;
    for (const nlohmann::json& item : value_)
      items.emplace_back(file_, name_ + "[" + std::to_string(items.size()) + "]", item);
    return items;
  }

  std::string Text() const {
    if (!value_.is_string() || value_.get_ref<const std::string&>().empty()) Fail("is not text");
    return value_;
  }

  double Number() const {
    if (!value_.is_number() || !std::isfinite(value_.get<double>())) Fail("is not a number");
    return value_;
  }

  int Size() const {
    const double number = Number();
    if (number < 1 || number > 1e6 || number != std::floor(number)) Fail("is not a size in pixels");
    return static_cast<int>(number);
  }

  Eigen::Vector3d Vector() const {
    const std::vector<Field> items = List();
    if (items.size() != 3) Fail("does not hold 3 numbers");
    return {items[0].Number(), items[1].Number(), items[2].Number()};
  }

  Eigen::Matrix3d Matrix() const {
    const std::vector<Field> rows = List();
    if (rows.size() != 3) Fail("does not hold 3 rows");
    Eigen::Matrix3d matrix;
    for (int i = 0; i < 3; ++i) matrix.row(i) = rows[i].Vector();
    return matrix;
  }

  [[noreturn]] void Fail(const std::string& problem) const {
    throw BadFile(file_.string(), "'" + (name_.empty() ? "the file" : name_) + "' " + problem,
                  "correct the file");
  }

 private:
  const fs::path& file_;
  std::string name_;
  const nlohmann::json& value_;
};

Eigen::Matrix3d ReadRotation(const Field& field) {
  const Eigen::Matrix3d matrix = field.Matrix();
  const Eigen::Matrix3d deviation = matrix * matrix.transpose() - Eigen::Matrix3d::Identity();
  if (deviation.cwiseAbs().maxCoeff() > kRotationTolerance || matrix.determinant() < 0)
    field.Fail("is not a rotation");
  return NearestRotation(matrix);
}

PinholeCamera ReadCamera(const Field& photo) {
  const Field field = photo.At("K");
  const Eigen::Matrix3d k = field.Matrix();
  const double tolerance = 1e-6 * std::abs(k(0, 0));
  if (std::abs(k(0, 1)) > tolerance || std::abs(k(1, 0)) > tolerance ||
      !k.row(2).isApprox(Eigen::RowVector3d(0, 0, 1))) {
    field.Fail("is not [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]");
  }
  // The file counts from the centre of the first pixel, PinholeCamera from its corner.
  const PinholeCamera camera{photo.At("width").Size(), photo.At("height").Size(), k(0, 0), k(1, 1),
                             k(0, 2) + 0.5,            k(1, 2) + 0.5};
  try {
    camera.Check();
  } catch (const InvalidOption& error) {
    field.Fail(std::string("is not a camera: ") + error.what());
  }
  return camera;
}

std::vector<fs::path> CameraFiles(const fs::path& root) {
  std::error_code error;
  if (!fs::is_directory(root, error))
    throw BadFile(root.string(), "is not a folder", "give a folder with cameras.json");
  if (fs::exists(root / kCameras, error)) return {root / kCameras};
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(root, error))
    if (std::error_code ignored; fs::exists(entry.path() / kCameras, ignored))
      files.push_back(entry.path() / kCameras);
  if (error) throw BadFile(root.string(), "cannot be listed: " + error.message());
  if (files.empty()) {
    throw BadFile(root.string(), "holds no cameras.json, nor does any folder in it",
                  "give a folder of photographs with cameras.json");
  }
  std::sort(files.begin(), files.end());
  return files;
}

void RequireSize(const cv::Mat& image, const PinholeCamera& camera, const fs::path& file) {
  if (image.cols == camera.width && image.rows == camera.height) return;
  throw BadFile(file.string(),
                "is " + std::to_string(image.cols) + " x " + std::to_string(image.rows) +
                    " pixels, but cameras.json says " + std::to_string(camera.width) + " x " +
                    std::to_string(camera.height),
                "correct the one or the other");
}

}  // namespace

PhotoDataset::Scene PhotoDataset::ReadScene(const fs::path& cameras_file) {
  const nlohmann::json json = ReadJsonFile(cameras_file);
  const Field root(cameras_file, "", json);
  const fs::path folder = cameras_file.parent_path();
  const Eigen::Vector3d centre = root.At("object").At("centre").Vector();
  const double radius = root.At("object").At("radius").Number();
  if (!(radius > 0)) root.At("object").At("radius").Fail("is not positive");

  Scene scene;
  scene.object = root.Has("name") ? root.At("name").Text() : folder.filename().string();
  for (const Field& entry : root.At("images").List()) {
    if (!entry.Has("mask")) continue;
    const std::string name = entry.At("file").Text();
    const Eigen::Matrix3d rotation = ReadRotation(entry.At("R"));
    const Eigen::Vector3d translation = entry.At("t").Vector();
    scene.photos.push_back({name, folder / name, folder / entry.At("mask").Text(),
                            ReadCamera(entry),
                            {rotation, (rotation * centre + translation) / radius}});
  }
  if (scene.photos.size() < 2) root.At("images").Fail("holds fewer than two images with masks");
  return scene;
}

PhotoDataset::PhotoDataset(const fs::path& root) {
  for (const fs::path& file : CameraFiles(root)) scenes_.push_back(ReadScene(file));
}

std::size_t PhotoDataset::PairCount() const {
  std::size_t count = 0;
  for (const Scene& scene : scenes_) count += scene.photos.size() * (scene.photos.size() - 1);
  return count;
}

EvaluationScene PhotoDataset::Load(std::size_t index) const {
  const Scene& source = scenes_.at(index);
  EvaluationScene scene;
  scene.object = source.object;
  for (const Photo& photo : source.photos) {
    const LoadedImage image = LoadImage(photo.image);
    RequireSize(image.rgb, photo.camera, photo.image);
    const ObjectMask mask = FindObjectMask(image, {photo.mask, std::nullopt}, photo.image.string());
    scene.views.push_back(
        {photo.name, {image.rgb, mask.mask, photo.camera}, photo.camera_from_object});
  }
  for (std::size_t reference = 0; reference < scene.views.size(); ++reference)
    for (std::size_t query = 0; query < scene.views.size(); ++query)
      if (query != reference) scene.pairs.push_back({reference, query});
  return scene;
}

}  // namespace antipode
