#include <cmath>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "antipode/evaluation/dataset.h"
#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/image/load.h"
#include "antipode/util/error.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 40;
constexpr int kHeight = 30;
const Eigen::Vector3d kCentre(5, -3, 2);
constexpr double kRadius = 4;

Rigid3 CameraFromObjectOf(int photo) {
  return CameraFromObject({.azimuth = 80.0 * photo, .elevation = 10.0 * photo, .distance = 5});
}

nlohmann::json ToJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

nlohmann::json ToJson(const Eigen::Matrix3d& m) {
  nlohmann::json rows;
  for (int i = 0; i < 3; ++i) rows.push_back(ToJson(Eigen::Vector3d(m.row(i).transpose())));
  return rows;
}

/// Photo 0..2 has a mask, photo 3 has none. The world is the object frame scaled and moved.
nlohmann::json Cameras() {
  nlohmann::json json{{"name", "toy"},
                      {"object", {{"centre", ToJson(kCentre)}, {"radius", kRadius}}}};
  for (int i = 0; i < 4; ++i) {
    const std::string number = std::to_string(i);
    const Rigid3 pose = CameraFromObjectOf(i);
    const Eigen::Vector3d translation = kRadius * pose.translation - pose.rotation * kCentre;
    nlohmann::json photo{{"file", "images/" + number + ".png"},
                         {"width", kWidth},
                         {"height", kHeight},
                         {"K", {{50.0, 0, 19.5}, {0, 51.0, 14.5}, {0, 0, 1}}},
                         {"R", ToJson(pose.rotation)},
                         {"t", ToJson(translation)}};
    if (i < 3) photo["mask"] = "masks/" + number + ".png";
    json["images"].push_back(photo);
  }
  return json;
}

void WriteCameras(const fs::path& folder, const nlohmann::json& json) {
  std::ofstream(folder / "cameras.json") << json;
}

void WritePhotos(const fs::path& folder) {
  fs::create_directories(folder / "images");
  fs::create_directories(folder / "masks");
  for (int i = 0; i < 3; ++i) {
    const std::string name = std::to_string(i) + ".png";
    cv::Mat mask = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
    mask(cv::Rect(10, 8, 12 + i, 10)).setTo(255);
    SaveImage(folder / "masks" / name, mask);
    SaveImage(folder / "images" / name,
              cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar(200, 10, 20 * i)));
  }
  WriteCameras(folder, Cameras());
}

class PhotoDatasetTest : public testing::Test {
 protected:
  PhotoDatasetTest() { WritePhotos(folder()); }
  const fs::path& folder() const { return temporary_.path(); }

  std::string MessageFor(const nlohmann::json& cameras) const {
    WriteCameras(folder(), cameras);
    try {
      PhotoDataset dataset(folder());
    } catch (const BadFile& error) {
      return error.what();
    }
    return "no error";
  }

 private:
  TemporaryFolder temporary_;
};

TEST_F(PhotoDatasetTest, TakesAllOrderedPairsOfMaskedImages) {
  const PhotoDataset dataset(folder());
  EXPECT_EQ(dataset.Name(), "photos");
  ASSERT_EQ(dataset.ObjectCount(), 1u);
  EXPECT_EQ(dataset.PairCount(), 6u);
  const EvaluationScene scene = dataset.Load(0);
  EXPECT_EQ(scene.object, "toy");
  ASSERT_EQ(scene.views.size(), 3u);
  ASSERT_EQ(scene.pairs.size(), 6u);
  EXPECT_EQ(scene.pairs[0].reference, 0u);
  EXPECT_EQ(scene.pairs[0].query, 1u);
  EXPECT_EQ(scene.pairs[5].reference, 2u);
  EXPECT_EQ(scene.pairs[5].query, 1u);
}

TEST_F(PhotoDatasetTest, ReadsImagesMasksAndCameras) {
  const EvaluationScene scene = PhotoDataset(folder()).Load(0);
  for (int i = 0; i < 3; ++i) {
    const SceneView& view = scene.views[i];
    EXPECT_EQ(view.name, "images/" + std::to_string(i) + ".png");
    EXPECT_EQ(view.photograph.image.at<cv::Vec3b>(3, 3), cv::Vec3b(200, 10, 20 * i));
    EXPECT_EQ(cv::countNonZero(view.photograph.mask), (12 + i) * 10);
    // (width - 1) / 2 counted from the pixel's centre is the middle of the image.
    EXPECT_DOUBLE_EQ(view.photograph.camera.cx, kWidth / 2.0);
    EXPECT_DOUBLE_EQ(view.photograph.camera.cy, kHeight / 2.0);
    EXPECT_DOUBLE_EQ(view.photograph.camera.fx, 50);
    EXPECT_DOUBLE_EQ(view.photograph.camera.fy, 51);
    EXPECT_EQ(view.photograph.camera.width, kWidth);
  }
}

TEST_F(PhotoDatasetTest, PosesAreRelativeToTheCentreInRadii) {
  const EvaluationScene scene = PhotoDataset(folder()).Load(0);
  for (int i = 0; i < 3; ++i) {
    const Rigid3& pose = scene.views[i].camera_from_object;
    EXPECT_TRUE(pose.Matrix().isApprox(CameraFromObjectOf(i).Matrix(), 1e-9)) << i;
    EXPECT_TRUE(pose.translation.isApprox(Eigen::Vector3d(0, 0, 5), 1e-9)) << i;
  }
}

TEST_F(PhotoDatasetTest, ReadsAFolderOfFolders) {
  const TemporaryFolder parent;
  for (const char* name : {"b", "a"}) {
    fs::create_directory(parent.path() / name);
    WritePhotos(parent.path() / name);
    nlohmann::json cameras = Cameras();
    cameras.erase("name");
    WriteCameras(parent.path() / name, cameras);
  }
  fs::create_directory(parent.path() / "other");
  const PhotoDataset dataset(parent.path());
  ASSERT_EQ(dataset.ObjectCount(), 2u);
  EXPECT_EQ(dataset.PairCount(), 12u);
  EXPECT_EQ(dataset.Load(0).object, "a");
  EXPECT_EQ(dataset.Load(1).object, "b");
}

TEST_F(PhotoDatasetTest, NamesTheFieldAtFault) {
  const auto broken = [&](const char* pointer, const nlohmann::json& value) {
    nlohmann::json cameras = Cameras();
    cameras[nlohmann::json::json_pointer(pointer)] = value;
    return MessageFor(cameras);
  };
  const auto expect = [](const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
    EXPECT_NE(message.find("cameras.json"), std::string::npos) << message;
  };
  expect(broken("/object/radius", 0), "'object.radius' is not positive");
  expect(broken("/object/radius", "1"), "'object.radius' is not a number");
  expect(broken("/object/centre", {1, 2}), "'object.centre' does not hold 3 numbers");
  expect(broken("/images/1/R", {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}}),
         "'images[1].R' is not a rotation");
  expect(broken("/images/1/R", {{2, 0, 0}, {0, 1, 0}, {0, 0, 1}}),
         "'images[1].R' is not a rotation");
  expect(broken("/images/0/K", {{50, 3, 20}, {0, 50, 15}, {0, 0, 1}}), "'images[0].K'");
  expect(broken("/images/0/K", {{-50, 0, 20}, {0, 50, 15}, {0, 0, 1}}),
         "'images[0].K' is not a camera");
  expect(broken("/images/0/width", 40.5), "'images[0].width' is not a size");
  expect(broken("/images/0/file", 7), "'images[0].file' is not text");
  expect(broken("/images", nlohmann::json::array()), "fewer than two");
  expect(broken("/images", 3), "'images' is not a list");
  expect(MessageFor(nlohmann::json::array()), "is not an object");
  nlohmann::json without_pose = Cameras();
  without_pose["images"][2].erase("t");
  expect(MessageFor(without_pose), "'images[2].t' is missing");
}

TEST_F(PhotoDatasetTest, RefusesPicturesOfAnotherSize) {
  nlohmann::json cameras = Cameras();
  cameras["images"][1]["width"] = 41;
  WriteCameras(folder(), cameras);
  EXPECT_THROW(PhotoDataset(folder()).Load(0), BadFile);
}

TEST_F(PhotoDatasetTest, RefusesWhatIsNotThere) {
  EXPECT_THROW(PhotoDataset(folder() / "missing"), BadFile);
  EXPECT_THROW(PhotoDataset(folder() / "images"), BadFile);
  fs::remove(folder() / "masks" / "1.png");
  EXPECT_THROW(PhotoDataset(folder()).Load(0), BadFile);
  std::ofstream(folder() / "cameras.json") << "{\"name\": ";
  EXPECT_THROW(PhotoDataset dataset(folder()), BadFile);
}

}  // namespace
}  // namespace antipode
