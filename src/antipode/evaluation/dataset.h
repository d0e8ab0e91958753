#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "antipode/evaluation/object_protocol.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/pose/two_view_pose.h"

namespace antipode {

/// One image of an object, with the true pose.
struct SceneView {
  std::string name;  ///< unique within the scene
  ObjectPhotograph photograph;
  Rigid3 camera_from_object;  ///< unit: object radii; the origin is the object's centre
};

/// Indices into `EvaluationScene::views`.
struct ViewPair {
  std::size_t reference = 0;
  std::size_t query = 0;
};

/// Everything known of one object: its images and which of them to compare.
struct EvaluationScene {
  std::string object;
  bool symmetric = false;  ///< known to look alike from several sides, so that no pose is unique
  std::vector<SceneView> views;
  std::vector<ViewPair> pairs;
};

/// Objects with posed images. Holds no images: they are made or read object by object.
class Dataset {
 public:
  virtual ~Dataset() = default;

  virtual std::string Name() const = 0;  ///< "objects" or "photos"
  virtual std::size_t ObjectCount() const = 0;
  virtual std::size_t PairCount() const = 0;  ///< of all objects together

  /// @throws BadFile naming the file that cannot be used
  virtual EvaluationScene Load(std::size_t index) const = 0;
};

/// Whether objects are symmetric, by file name without extension.
using SymmetryTable = std::map<std::string, bool>;

/// From `root/manifest.json`, else `root/../manifest.json`: entries {"id" or "file", "symmetric":
/// "none" | other}. Empty if there is neither file.
/// @throws BadFile if the manifest is malformed
SymmetryTable ReadSymmetryTable(const std::filesystem::path& root);

/// Meshes rendered by the protocol of object_protocol.h: the first view of an object is the
/// reference of all the others. Meshes are centred and scaled to radius 1.
class ObjectDataset : public Dataset {
 public:
  /// @param root a folder of *.glb
  /// @throws BadFile naming the folder if it is missing or holds none; InvalidOption
  explicit ObjectDataset(const std::filesystem::path& root, ObjectProtocolOptions options = {});

  std::string Name() const override { return "objects"; }
  std::size_t ObjectCount() const override { return files_.size(); }
  std::size_t PairCount() const override;
  EvaluationScene Load(std::size_t index) const override;

 private:
  std::vector<std::filesystem::path> files_;
  SymmetryTable symmetric_;
  ObjectProtocolOptions options_;
};

/// Photographs with masks and known cameras; all ordered pairs of the images of one folder.
///
/// Each folder holds `cameras.json`:
///   {"name": "..", "object": {"centre": [x, y, z], "radius": r},
///    "images": [{"file": "..", "mask": "..", "width": w, "height": h,
///                "K": 3x3, "R": 3x3, "t": [x, y, z]}, ..]}
/// with x_camera = R X + t in any world unit, OpenCV axes and pixel centres at integers (0.5 is
/// added to the principal point). Images without "mask" are left out. The object frame keeps the
/// axes of the world: camera_from_object = (R, (R centre + t) / radius).
class PhotoDataset : public Dataset {
 public:
  /// @param root one such folder, or a folder of such folders
  /// @throws BadFile naming the file and the field if there is none or one is malformed
  explicit PhotoDataset(const std::filesystem::path& root);

  std::string Name() const override { return "photos"; }
  std::size_t ObjectCount() const override { return scenes_.size(); }
  std::size_t PairCount() const override;
  EvaluationScene Load(std::size_t index) const override;

 private:
  struct Photo {
    std::string name;
    std::filesystem::path image;
    std::filesystem::path mask;
    PinholeCamera camera;
    Rigid3 camera_from_object;
  };
  struct Scene {
    std::string object;
    std::vector<Photo> photos;
  };

  static Scene ReadScene(const std::filesystem::path& cameras_file);

  std::vector<Scene> scenes_;
};

}  // namespace antipode
