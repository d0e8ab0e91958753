#include "antipode/object/object_view.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kTrials = 200;

class RandomScene {
 public:
  explicit RandomScene(unsigned seed) : generator_(seed) {}

  double Between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator_);
  }

  PinholeCamera Camera() {
    const double focal_length = Between(450, 1200);
    return {640,
            480,
            focal_length,
            focal_length * Between(0.97, 1.03),
            Between(280, 360),
            Between(200, 280)};
  }

  cv::Rect2d Box() {
    const double width = Between(20, 200), height = Between(20, 200);
    return {Between(0, 640 - width), Between(0, 480 - height), width, height};
  }

  Eigen::Matrix3d Rotation() {
    std::normal_distribution<double> normal;
    const Eigen::Quaterniond quaternion(normal(generator_), normal(generator_), normal(generator_),
                                        normal(generator_));
    return quaternion.normalized().toRotationMatrix();
  }

 private:
  std::mt19937_64 generator_;
};

Eigen::Vector2d Centre(const cv::Rect2d& box) {
  return {box.x + 0.5 * box.width, box.y + 0.5 * box.height};
}

/// A picture of the unit sphere: colour is a smooth function of the surface point in the frame of a
/// camera that looks at the sphere, so that it looks the same wherever the sphere stands in the
/// picture.
struct SphereScene {
  PinholeCamera camera;
  Eigen::Vector3d centre;

  cv::Mat image;
  cv::Mat mask;

  SphereScene(const PinholeCamera& its_camera, const Eigen::Vector3d& its_centre)
      : camera(its_camera),
        centre(its_centre),
        image(camera.height, camera.width, CV_8UC3, cv::Scalar(40, 90, 160)),
        mask(camera.height, camera.width, CV_8UC1, cv::Scalar(0)) {
    const double alpha = std::atan2(centre.x(), centre.z());
    const double beta = std::atan2(centre.y(), std::hypot(centre.x(), centre.z()));
    const Eigen::Matrix3d facing = (Eigen::AngleAxisd(beta, Eigen::Vector3d::UnitX()) *
                                    Eigen::AngleAxisd(-alpha, Eigen::Vector3d::UnitY()))
                                       .toRotationMatrix();
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) Shade(x, y, facing);
    }
  }

 private:
  void Shade(int x, int y, const Eigen::Matrix3d& facing) {
    const Eigen::Vector3d ray = camera.Ray({x + 0.5, y + 0.5}).normalized();
    const double along = ray.dot(centre);
    const double discriminant = along * along - centre.squaredNorm() + 1;
    if (discriminant < 0) return;
    const Eigen::Vector3d normal = ray * (along - std::sqrt(discriminant)) - centre;
    const Eigen::Vector3d seen = facing * normal;
    mask.at<uchar>(y, x) = 255;
    for (int c = 0; c < 3; ++c) {
      image.at<cv::Vec3b>(y, x)[c] =
          static_cast<uchar>(128 + 100 * std::sin(3 * seen[c] + 2 * seen[(c + 1) % 3]));
    }
  }
};

double MeanAbsoluteDifference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total() * a.channels());
}

cv::Mat FilledRectangle(const cv::Size& size, const cv::Rect& box) {
  cv::Mat mask = cv::Mat::zeros(size, CV_8UC1);
  mask(box).setTo(255);
  return mask;
}

TEST(LookAtBox, TurnsWithARotationThatPutsTheBoxCentreOnThePrincipalPoint) {
  RandomScene scene(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const PinholeCamera camera = scene.Camera();
    const cv::Rect2d box = scene.Box();
    const ObjectCrop crop = LookAtBox(camera, box);

    const Eigen::Matrix3d& rotation = crop.crop_from_camera;
    EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-13);
    EXPECT_NEAR(rotation.determinant(), 1, 1e-13);
    EXPECT_NEAR(rotation(0, 1), 0, 1e-15) << "the crop's x axis has left the horizontal plane";
    const Eigen::Vector3d ray = camera.Ray(Centre(box));
    EXPECT_LT((rotation.row(2).transpose() - ray.normalized()).norm(), 1e-13);
    const Eigen::Vector2d pixel =
        (CropHomography(camera, crop) * ray.cwiseProduct(Eigen::Vector3d(camera.fx, camera.fy, 1)) +
         CropHomography(camera, crop) * Eigen::Vector3d(camera.cx, camera.cy, 0))
            .hnormalized();
    EXPECT_LT((pixel - Eigen::Vector2d(64, 64)).norm(), 1e-9);
  }
}

TEST(LookAtBox, AgreesWithTheWorkedExampleUpToTheExactElevation) {
  const PinholeCamera camera{640, 480, 600, 600, 320, 240};
  const ObjectCrop crop = LookAtBox(camera, cv::Rect2d(400, 100, 120, 200));
  Eigen::Matrix3d as_published;
  as_published << 0.973841, 0, -0.227230, 0.015115, 0.997785, 0.064779, 0.226726, -0.066519,
      0.971684;
  const Eigen::AngleAxisd difference(crop.crop_from_camera * as_published.transpose());
  EXPECT_NEAR(difference.angle() * 180 / std::numbers::pi, 0.0992, 0.001);
  EXPECT_NEAR(std::abs(difference.axis().x()), 1, 1e-4);
}

TEST(LookAtBox, FillsTheSquareWithTheBoxAndItsMargins) {
  RandomScene scene(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const PinholeCamera camera = scene.Camera();
    const cv::Rect2d box = scene.Box();
    const ObjectViewOptions options{.size = 160, .margin = scene.Between(0, 0.3)};
    const ObjectCrop crop = LookAtBox(camera, box, options);
    const auto seen = [&](double x_fraction, double y_fraction) {
      return crop.camera.Project(
          crop.crop_from_camera *
          camera.Ray({box.x + x_fraction * box.width, box.y + y_fraction * box.height}));
    };
    const double width = (seen(1, 0.5) - seen(0, 0.5)).x();
    const double height = (seen(0.5, 1) - seen(0.5, 0)).y();
    EXPECT_NEAR(std::max(width, height) * (1 + 2 * options.margin), 160, 1e-9);
  }
}

TEST(LookAtBox, RefusesWhatCannotBeLookedAt) {
  const PinholeCamera wide = PinholeCamera::FromFieldOfView(1000, 1000, 176);
  EXPECT_THROW(LookAtBox(wide, cv::Rect2d(0, 0, 1000, 600)), Error);
  EXPECT_THROW(LookAtBox(wide, cv::Rect2d(10, 10, 0, 5)), InvalidOption);
  EXPECT_THROW(LookAtBox(wide, cv::Rect2d(10, 10, 5, NAN)), InvalidOption);
  EXPECT_THROW(LookAtBox(wide, cv::Rect2d(10, 10, 5, 5), {.size = 0}), InvalidOption);
  EXPECT_THROW(LookAtBox(wide, cv::Rect2d(10, 10, 5, 5), {.margin = -0.1}), InvalidOption);
}

TEST(CropHomography, MapsPixelsAsTheTurnedCameraSeesThem) {
  RandomScene scene(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const PinholeCamera camera = scene.Camera();
    const ObjectCrop crop = LookAtBox(camera, scene.Box());
    const Eigen::Vector3d point(scene.Between(-0.3, 0.3), scene.Between(-0.3, 0.3), 1);
    const Eigen::Vector3d in_space = point * scene.Between(0.5, 9);
    const Eigen::Vector2d by_homography =
        (CropHomography(camera, crop) * camera.Project(in_space).homogeneous()).hnormalized();
    EXPECT_LT((by_homography - crop.camera.Project(crop.crop_from_camera * in_space)).norm(), 1e-8);
  }
}

TEST(MakeObjectView, ShowsASphereAlikeWhereverItStoodInThePicture) {
  const PinholeCamera camera{480, 360, 500, 500, 240, 180};
  const SphereScene straight(camera, {0, 0, 6});
  const ObjectView reference = MakeObjectView(straight.image, straight.mask, camera, {.size = 96});
  RandomScene random(4);
  for (int trial = 0; trial < 12; ++trial) {
    const Eigen::Vector3d direction(random.Between(-0.25, 0.25), random.Between(-0.14, 0.14), 1);
    const SphereScene moved(camera, 6 * direction.normalized());
    const ObjectView view = MakeObjectView(moved.image, moved.mask, camera, {.size = 96});
    // The middle of the off-axis ellipse is up to 1.7 crop pixels beside the sphere's centre.
    EXPECT_LT(MeanAbsoluteDifference(view.image, reference.image), 9.0);
    EXPECT_NEAR(view.distance, reference.distance, 0.01 * reference.distance);
    const Eigen::Vector3d seen = view.crop_from_camera * direction.normalized();
    EXPECT_LT(std::acos(std::min(1.0, seen.z())) * 180 / std::numbers::pi, 0.5);
  }
}

TEST(MakeObjectView, IsWhiteOutsideTheMaskAndReportsCoverage) {
  const cv::Mat image(300, 400, CV_8UC3, cv::Scalar(10, 20, 30));
  const cv::Mat mask = FilledRectangle(image.size(), {150, 100, 100, 100});
  const ObjectView view = MakeObjectView(image, mask, PinholeCamera::FromFieldOfView(400, 300, 40),
                                         {.size = 110, .margin = 0.05});
  EXPECT_EQ(view.image.at<cv::Vec3b>(1, 1), cv::Vec3b(255, 255, 255));
  EXPECT_EQ(view.image.at<cv::Vec3b>(55, 55), cv::Vec3b(10, 20, 30));
  EXPECT_EQ(view.mask.at<uchar>(1, 1), 0);
  EXPECT_EQ(view.mask.at<uchar>(55, 55), 255);
  const double object_side = std::sqrt(cv::sum(view.mask)[0] / 255);
  EXPECT_NEAR(object_side, 100, 0.5);
}

TEST(MakeObjectView, CentresTheObjectAtEveryReduction) {
  for (const int side : {30, 64, 131, 257, 512, 1111}) {
    const cv::Mat image(1300, 1300, CV_8UC3, cv::Scalar::all(0));
    const int start = (1300 - side) / 2;
    const cv::Mat mask = FilledRectangle(image.size(), {start, start, side, side});
    const PinholeCamera camera{1300, 1300, 2000, 2000, start + 0.5 * side, start + 0.5 * side};
    const ObjectView view = MakeObjectView(image, mask, camera, {.size = 64});
    const cv::Moments moments = cv::moments(view.mask);
    EXPECT_NEAR(moments.m10 / moments.m00 + 0.5, 32, 0.05) << side;
    EXPECT_NEAR(moments.m01 / moments.m00 + 0.5, 32, 0.05) << side;
    EXPECT_NEAR(std::sqrt(cv::sum(view.mask)[0] / 255), 64 / 1.1, 0.2) << side;
  }
}

TEST(MakeObjectView, ShrinksAFineCheckerboardToGrey) {
  constexpr int kSide = 1024;
  cv::Mat image(kSide + 200, kSide + 200, CV_8UC3);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<cv::Vec3b>(y, x) = cv::Vec3b::all((x + y) % 2 == 0 ? 255 : 0);
    }
  }
  const cv::Mat mask = FilledRectangle(image.size(), {100, 100, kSide, kSide});
  for (const int size : {70, 110, 128, 140, 300}) {
    const ObjectView view = MakeObjectView(
        image, mask, PinholeCamera::FromFieldOfView(image.cols, image.rows, 30), {.size = size});
    const cv::Rect inner(size / 5, size / 5, size * 3 / 5, size * 3 / 5);
    cv::Scalar mean, deviation;
    cv::meanStdDev(view.image(inner), mean, deviation);
    EXPECT_NEAR(mean[0], 127.5, 3) << size;
    EXPECT_LT(deviation[0], 10) << size;
  }
}

TEST(MakeObjectView, KeepsTheLargestBlobOnlyAndSaysSo) {
  const cv::Mat image(200, 300, CV_8UC3, cv::Scalar::all(0));
  cv::Mat mask = FilledRectangle(image.size(), {20, 30, 60, 60});
  const PinholeCamera camera = PinholeCamera::FromFieldOfView(300, 200, 40);
  const ObjectView alone = MakeObjectView(image, mask, camera);
  EXPECT_TRUE(alone.warnings.empty());
  mask(cv::Rect(84, 40, 10, 10)).setTo(255);
  mask(cv::Rect(280, 180, 20, 20)).setTo(200);
  const ObjectView among_others = MakeObjectView(image, mask, camera);
  EXPECT_EQ(cv::norm(alone.image, among_others.image, cv::NORM_INF), 0);
  ASSERT_EQ(among_others.warnings.size(), 1u);
  EXPECT_NE(among_others.warnings[0].find("3 separate parts"), std::string::npos);
}

TEST(MakeObjectView, WarnsOfAnObjectAtTheBorder) {
  const cv::Mat image(200, 300, CV_8UC3, cv::Scalar::all(0));
  const ObjectView view = MakeObjectView(image, FilledRectangle(image.size(), {240, 30, 60, 60}),
                                         PinholeCamera::FromFieldOfView(300, 200, 40));
  ASSERT_EQ(view.warnings.size(), 1u);
  EXPECT_NE(view.warnings[0].find("border"), std::string::npos);
}

TEST(MakeObjectView, LeavesItsInputsAlone) {
  cv::Mat image(200, 300, CV_8UC3);
  cv::randu(image, 0, 255);
  cv::Mat mask = FilledRectangle(image.size(), {100, 50, 90, 120});
  mask(cv::Rect(0, 0, 9, 9)).setTo(255);
  const cv::Mat image_before = image.clone(), mask_before = mask.clone();
  MakeObjectView(image, mask, PinholeCamera::FromFieldOfView(300, 200, 40));
  EXPECT_EQ(cv::norm(image, image_before, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(mask, mask_before, cv::NORM_INF), 0);
}

TEST(MakeObjectView, RefusesUnusableInput) {
  const cv::Mat image(200, 300, CV_8UC3, cv::Scalar::all(0));
  const cv::Mat mask = FilledRectangle(image.size(), {100, 50, 90, 120});
  const PinholeCamera camera = PinholeCamera::FromFieldOfView(300, 200, 40);
  EXPECT_THROW(MakeObjectView(image, cv::Mat::zeros(200, 300, CV_8UC1), camera), Error);
  EXPECT_THROW(MakeObjectView(image, FilledRectangle(image.size(), {0, 0, 300, 200}), camera),
               Error);
  EXPECT_THROW(MakeObjectView(image, mask(cv::Rect(0, 0, 250, 200)), camera), Error);
  EXPECT_THROW(MakeObjectView(image, cv::Mat(), camera), Error);
  EXPECT_THROW(MakeObjectView(cv::Mat(), mask, camera), Error);
  EXPECT_THROW(MakeObjectView(image, mask, PinholeCamera::FromFieldOfView(200, 300, 40)), Error);
}

/// The view of an object at the origin of object coordinates, without a picture.
ObjectView ViewOfOrigin(const PinholeCamera& camera, const Rigid3& camera_from_object) {
  const Eigen::Vector2d pixel = camera.Project(camera_from_object.translation);
  ObjectView view;
  view.crop_from_camera =
      LookAtBox(camera, cv::Rect2d(pixel.x() - 5, pixel.y() - 5, 10, 10)).crop_from_camera;
  view.distance = camera_from_object.translation.norm();
  return view;
}

TEST(ComposeFromCrops, RecoversThePoseOfCamerasThatLookAtOrPastTheObject) {
  RandomScene scene(5);
  for (const double off_axis : {0.0, 0.3}) {
    for (int trial = 0; trial < kTrials; ++trial) {
      const auto pose = [&] {
        const double depth = scene.Between(2, 8);
        return Rigid3{scene.Rotation(),
                      Eigen::Vector3d(scene.Between(-off_axis, off_axis) * depth,
                                      scene.Between(-off_axis, off_axis) * depth, depth)};
      };
      const Rigid3 reference_from_object = pose(), query_from_object = pose();
      const ObjectView reference = ViewOfOrigin(scene.Camera(), reference_from_object);
      const ObjectView query = ViewOfOrigin(scene.Camera(), query_from_object);
      const Eigen::Matrix3d between_crops = query.crop_from_camera * query_from_object.rotation *
                                            reference_from_object.rotation.transpose() *
                                            reference.crop_from_camera.transpose();
      const Rigid3 expected = query_from_object * reference_from_object.Inverse();
      const Rigid3 composed = ComposeFromCrops(reference, query, between_crops);
      EXPECT_LT((composed.rotation - expected.rotation).norm(), 1e-10);
      EXPECT_LT((composed.translation - expected.translation).norm(), 1e-9);
    }
  }
}

TEST(ComposeFromCrops, RecoversTheDirectionFromPicturesOfASphere) {
  const PinholeCamera camera{480, 360, 500, 500, 240, 180};
  const SphereScene first(camera, {0.9, -0.4, 7}), second(camera, {-0.7, 0.6, 5});
  const ObjectView reference = MakeObjectView(first.image, first.mask, camera, {.size = 96});
  const ObjectView query = MakeObjectView(second.image, second.mask, camera, {.size = 96});
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(2.0, Eigen::Vector3d(0.2, 0.9, -0.3).normalized()).toRotationMatrix();
  const Rigid3 expected{turn, second.centre - turn * first.centre};
  const Rigid3 composed = ComposeFromCrops(
      reference, query, query.crop_from_camera * turn * reference.crop_from_camera.transpose());
  const double cosine = composed.translation.normalized().dot(expected.translation.normalized());
  EXPECT_LT(std::acos(cosine) * 180 / std::numbers::pi, 0.5);
  EXPECT_LT((composed.translation - expected.translation).norm(),
            0.03 * expected.translation.norm());
}

}  // namespace
}  // namespace antipode
