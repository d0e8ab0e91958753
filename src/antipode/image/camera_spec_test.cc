#include "antipode/image/camera_spec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "antipode/util/temporary_folder.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kWidth = 640, kHeight = 480;

SourcedCamera Resolve(const std::string& spec) {
  return ResolveCamera(spec, kWidth, kHeight, 777.0);
}

std::string ReasonForRefusing(const std::string& spec) {
  try {
    Resolve(spec);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

void ExpectCamera(const SourcedCamera& sourced, const PinholeCamera& expected) {
  EXPECT_EQ(sourced.camera.width, expected.width);
  EXPECT_EQ(sourced.camera.height, expected.height);
  EXPECT_NEAR(sourced.camera.fx, expected.fx, 1e-9);
  EXPECT_NEAR(sourced.camera.fy, expected.fy, 1e-9);
  EXPECT_NEAR(sourced.camera.cx, expected.cx, 1e-9);
  EXPECT_NEAR(sourced.camera.cy, expected.cy, 1e-9);
}

TEST(ResolveCamera, UnderstandsShortForms) {
  ExpectCamera(Resolve("fov=90"), {kWidth, kHeight, 320, 320, 320, 240});
  ExpectCamera(Resolve("f=512.5"), {kWidth, kHeight, 512.5, 512.5, 320, 240});
  ExpectCamera(Resolve("500,510,321,239"), {kWidth, kHeight, 500, 510, 321, 239});
  ExpectCamera(Resolve("500, 510, 321, 239"), {kWidth, kHeight, 500, 510, 321, 239});
  EXPECT_EQ(Resolve("f=1").source, "given");
}

TEST(ResolveCamera, FallsBackOnExifAndThenOnFiftyDegrees) {
  const SourcedCamera exif = ResolveCamera({}, kWidth, kHeight, 777.0);
  EXPECT_EQ(exif.source, "exif");
  ExpectCamera(exif, {kWidth, kHeight, 777, 777, 320, 240});
  const SourcedCamera assumed = ResolveCamera({}, kHeight, kWidth, {});
  EXPECT_EQ(assumed.source, "assumed");
  const double focal_length = 320 / std::tan(25 * std::numbers::pi / 180);
  ExpectCamera(assumed, {kHeight, kWidth, focal_length, focal_length, 240, 320});
  EXPECT_EQ(ResolveCamera({}, kWidth, kHeight, NAN).source, "assumed");
}

TEST(ResolveCamera, ReadsJson) {
  const TemporaryFolder folder;
  const PinholeCamera expected{kWidth, kHeight, 500, 510, 321, 239};
  const char* const texts[] = {
      R"({"fx": 500, "fy": 510, "cx": 321, "cy": 239, "width": 640, "height": 480})",
      R"({"K": [[500, 0, 321], [0, 510, 239], [0, 0, 1]]})",
      R"({"K": [500, 0, 321, 0, 510, 239, 0, 0, 1], "width": 640, "height": 480})"};
  for (const char* const text : texts) {
    ExpectCamera(Resolve(folder.Write("camera.json", text).string()), expected);
  }
}

TEST(ResolveCamera, RefusesUnusableJson) {
  const TemporaryFolder folder;
  const char* const texts[] = {
      "{",
      "[]",
      "{}",
      R"({"fx": "500", "fy": 510, "cx": 321, "cy": 239})",
      R"({"fx": 500, "fy": 510, "cx": 321, "cy": 239, "width": 641, "height": 480})",
      R"({"fx": 500, "fy": 510, "cx": 321, "cy": 239, "width": 1e99, "height": 480})",
      R"({"fx": -500, "fy": 510, "cx": 321, "cy": 239})",
      R"({"fx": 1e999, "fy": 510, "cx": 321, "cy": 239})",
      R"({"K": [[500, 3, 321], [0, 510, 239], [0, 0, 1]]})",
      R"({"K": [[500, 0, 321], [0, 510, 239], [0, 0, 2]]})",
      R"({"K": [[500, 0, 321], [0, 510, 239]]})",
      R"({"K": [1, 2, 3]})",
      R"({"K": "x"})"};
  for (const char* const text : texts) {
    const std::string path = folder.Write("camera.json", text).string();
    EXPECT_TRUE(ReasonForRefusing(path).starts_with(path))
        << text << ": " << ReasonForRefusing(path);
  }
}

TEST(ResolveCamera, ReadsColmapCameras) {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "cameras.txt").string();
  folder.Write("cameras.txt", "# Camera list\n\n1 PINHOLE 640 480 500 510 321 239\r\n");
  ExpectCamera(Resolve(path), {kWidth, kHeight, 500, 510, 321, 239});
  folder.Write("cameras.txt", "1 SIMPLE_PINHOLE 640 480 500 321 239\n2 PINHOLE 64 48 9 9 9 9\n");
  ExpectCamera(Resolve(path), {kWidth, kHeight, 500, 500, 321, 239});
}

TEST(ResolveCamera, RefusesUnusableColmapCamerasByName) {
  const TemporaryFolder folder;
  const auto reason_for = [&](const std::string& text) {
    return ReasonForRefusing(folder.Write("cameras.txt", text).string());
  };
  const std::string distorted = reason_for("1 OPENCV 640 480 500 510 321 239 0.1 0 0 0\n");
  EXPECT_NE(distorted.find("OPENCV"), std::string::npos);
  EXPECT_NE(distorted.find("undistort"), std::string::npos);
  EXPECT_NE(reason_for("1 WONDER 640 480 500\n").find("'WONDER'"), std::string::npos);
  EXPECT_NE(reason_for("1 PINHOLE 641 480 500 510 321 239\n").find("641 x 480"), std::string::npos);
  EXPECT_NE(reason_for("1 PINHOLE 640 480 500 510 321\n").find("3 parameters"), std::string::npos);
  EXPECT_NE(reason_for("1 PINHOLE 640 480 500 510 321 x\n"), "");
  EXPECT_NE(reason_for("1 PINHOLE 640 480 0 510 321 239\n"), "");
  EXPECT_NE(reason_for("1 PINHOLE 640 480 500 510 321 239\n2 PINHOLE 640 480 600 610 321 239\n")
                .find("several"),
            std::string::npos);
  EXPECT_NE(reason_for("# nothing\n").find("no camera"), std::string::npos);
  EXPECT_NE(reason_for(""), "");
  EXPECT_NE(reason_for("hello"), "");
  EXPECT_NE(reason_for(std::string("\0\x01\xFF", 3)), "");
}

TEST(ResolveCamera, RefusesImpossibleValues) {
  for (const char* const spec : {"", "fov=0", "fov=180", "fov=nan", "fov=", "fov=x", "f=0", "f=-3",
                                 "f=inf", "f=1e999", "1,2,3", "1,2,3,4,5", "500,500,99999,0",
                                 "500,nan,320,240", "no-such-file.txt", "zoom=3", "/"}) {
    const std::string reason = ReasonForRefusing(spec);
    EXPECT_NE(reason, "") << spec;
    EXPECT_EQ(reason.find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace antipode
