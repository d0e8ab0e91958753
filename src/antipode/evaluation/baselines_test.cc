#include "antipode/evaluation/baselines.h"

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"
#include "antipode/util/temporary_folder.h"

namespace antipode {
namespace {

/// Sees 100 known points of a world exactly.
class KnownMatcher : public Matcher {
 public:
  explicit KnownMatcher(Correspondences points) : points_(std::move(points)) {}
  Correspondences Match(const cv::Mat&, const cv::Mat&) const override { return points_; }

 private:
  Correspondences points_;
};

TEST(DepthBaseline, FindsThePoseFromDepthAndFailsWithout) {
  const PinholeCamera camera{200, 200, 300, 300, 100, 100};
  const Rigid3 truth{RotationAboutY(0.4), {0.1, 0.2, 0.3}};
  ObjectPhotograph reference, query;
  reference.camera = query.camera = camera;
  reference.image = query.image = cv::Mat(200, 200, CV_8UC3, cv::Scalar::all(128));
  reference.mask = query.mask = cv::Mat::zeros(200, 200, CV_8U);
  reference.mask(cv::Rect(50, 50, 100, 100)) = 255;
  reference.depth = cv::Mat::zeros(200, 200, CV_32F);
  query.depth = cv::Mat::zeros(200, 200, CV_32F);
  Correspondences points;
  std::mt19937_64 random(1);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d point = 0.5 * RandomRotation(random).col(0) + Eigen::Vector3d(0, 0, 4);
    points.reference.push_back(camera.Project(point));
    points.query.push_back(camera.Project(truth * point));
    points.scores.push_back(1);
    const auto put = [](cv::Mat& depth, const Eigen::Vector2d& pixel, double z) {
      depth.at<float>(static_cast<int>(pixel.y()), static_cast<int>(pixel.x())) = static_cast<float>(z);
    };
    put(reference.depth, points.reference.back(), point.z());
    put(query.depth, points.query.back(), (truth * point).z());
  }
  const auto matcher = std::make_shared<KnownMatcher>(points);
  const SceneView a{"a", reference, {}}, b{"b", query, {}};
  for (const DepthSolver solver : {DepthSolver::kPnp, DepthSolver::kProcrustes}) {
    const TwoViewPose pose = DepthBaseline("depth", matcher, solver).estimate({"object", a, b});
    EXPECT_LT(AngleBetweenDeg(pose.query_from_reference.rotation, truth.rotation), 1);
    EXPECT_LT((pose.query_from_reference.translation - truth.translation).norm(), 0.05);
    EXPECT_THROW(DepthBaseline("depth", matcher, solver).estimate({"object", SceneView{}, b}), Error);
  }
}

TEST(Predictions, AreLookedUpByName) {
  TemporaryFolder folder;
  const auto path = folder.Write("poses.csv",
                                 "query,object,reference,qw,qx,qy,qz,tx,ty,tz\r\n"
                                 "1,mug,0,0,0,2,0,1,2,3\r\n");
  const PoseMethod method = Predictions(path);
  const SceneView zero{"0", {}, {}}, one{"1", {}, {}};
  const TwoViewPose pose = method.estimate({"mug", zero, one});
  EXPECT_LT(AngleBetweenDeg(pose.query_from_reference.rotation, RotationAboutY(std::numbers::pi)), 1e-6);
  EXPECT_EQ(pose.query_from_reference.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_THROW(method.estimate({"mug", one, zero}), Error);
}

TEST(Predictions, RefuseDamagedFiles) {
  TemporaryFolder folder;
  const std::string header = "object,reference,query,qw,qx,qy,qz,tx,ty,tz\n";
  for (const std::string& text : {std::string("object,reference,query\n"), header + "mug,0,1,1,0,0\n",
                                  header + "mug,0,1,1,0,0,zero,0,0,1\n", header + "mug,0,1,0,0,0,0,0,0,1\n"})
    EXPECT_THROW(Predictions(folder.Write("poses.csv", text)), BadFile) << text;
}

}  // namespace
}  // namespace antipode
