#include <iostream>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/photograph_input.h"
#include "antipode/geometry/rotation.h"
#include "antipode/image/load.h"
#include "antipode/matching/matchers.h"
#include "antipode/nn/device.h"
#include "antipode/pose/two_view_pose.h"
#include "antipode/report/match_picture.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/suggest.h"
#include "antipode/util/version.h"

namespace antipode {
namespace {

using Json = nlohmann::ordered_json;

class MatchCommand : public Command {
 public:
  std::string Name() const override { return "match"; }
  std::string Summary() const override { return "Correspondences of two photographs and the pose that they give"; }
  std::string Example() const override {
    return "  antipode match front.jpg side.jpg --reference-mask front_mask.png --query-mask side_mask.png "
           "--visualize matches.png";
  }

  void DeclareOptions(CLI::App& app) override {
    reference_.Declare(app, "reference");
    query_.Declare(app, "query");
    app.add_option("--matcher", matcher_, JoinNames(MatcherNames()) + "; loftr after its import")
        ->capture_default_str()->type_name("NAME");
    app.add_option("--size", size_, "Side of the object-centric crops that are matched, pixels")
        ->capture_default_str()->type_name("N")->check(CLI::Range(64, 2048));
    app.add_option("--threshold", options_.geometry.threshold_px, "Distance of a consistent match from its epipolar line, pixels")
        ->capture_default_str()->type_name("PIXELS");
    app.add_option("--visualize", picture_, "Draw the matches into a PNG or JPEG picture")->type_name("FILE");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    options_.Check();
    const PhotographInput reference = LoadPhotograph(reference_, "reference"), query = LoadPhotograph(query_, "query");
    const SeenPhotograph seen_reference{View(reference.photograph), reference.photograph.camera};
    const SeenPhotograph seen_query{View(query.photograph), query.photograph.camera};
    const auto matcher = MakeMatcher(matcher_, SelectDevice(common_.device));
    ThrowIfInterrupted();
    const MatchedViews matched = MatchObjectViews(*matcher, seen_reference.view, seen_query.view, options_);
    if (picture_) SaveImage(*picture_, DrawMatchPicture(seen_reference.view, seen_query.view, matched));
    common_.WriteJson(ToJson(matched, seen_reference, seen_query));
    if (common_.PrintsText()) Print(matched);
  }

 private:
  struct SeenPhotograph {
    ObjectView view;
    PinholeCamera camera;
  };

  ObjectView View(const ObjectPhotograph& photograph) const {
    return MakeObjectView(photograph.image, photograph.mask, photograph.camera, {.size = size_});
  }

  /// Pixels of the photograph from pixels of its crop.
  static Json InPhotograph(const Eigen::Vector2d& pixel, const SeenPhotograph& seen) {
    const Eigen::Vector3d ray = seen.view.crop_from_camera.transpose() * seen.view.camera.Ray(pixel);
    const Eigen::Vector2d point = seen.camera.Project(ray);
    return {point.x(), point.y()};
  }

  Json ToJson(const MatchedViews& matched, const SeenPhotograph& reference, const SeenPhotograph& query) const {
    Json matches = Json::array();
    for (std::size_t i = 0; i < matched.correspondences.size(); ++i) {
      matches.push_back({{"reference", InPhotograph(matched.correspondences.reference[i], reference)},
                         {"query", InPhotograph(matched.correspondences.query[i], query)},
                         {"score", matched.correspondences.scores[i]},
                         {"inlier", matched.geometry.is_inlier[i] != 0}});
    }
    Json json{{"antipode", Version()},
              {"matcher", matcher_},
              {"status", NameOf(matched.geometry.status)},
              {"matches", matched.correspondences.size()},
              {"inliers", matched.geometry.inliers},
              {"query_turned_deg", 90 * matched.quarter_turns}};
    if (matched.geometry.status != TwoViewStatus::kTooFewMatches)
      json["query_from_reference"] = PoseJson(matched.geometry, reference.view, query.view);
    json["correspondences"] = std::move(matches);
    return json;
  }

  static Json PoseJson(const TwoViewGeometry& geometry, const ObjectView& reference, const ObjectView& query) {
    const Rigid3 pose = BetweenCameras(reference, query, geometry.query_from_reference);
    const Eigen::Vector3d& direction = pose.translation;
    const Eigen::Vector4d quaternion = QuaternionWxyz(pose.rotation);
    return {{"quaternion_wxyz", {quaternion[0], quaternion[1], quaternion[2], quaternion[3]}},
            {"translation_direction", {direction.x(), direction.y(), direction.z()}},
            {"rotation_angle_deg", RotationAngleDeg(pose.rotation)},
            {"rotation_deviation_deg", std::min(geometry.RotationDeviationDeg(), 180.0)}};
  }

  void Print(const MatchedViews& matched) const {
    const TwoViewGeometry& geometry = matched.geometry;
    std::cout << Formatted("%zu matches, %d of them consistent: %s\n", matched.correspondences.size(), geometry.inliers,
                           NameOf(geometry.status).c_str());
    if (matched.quarter_turns != 0)
      std::cout << Formatted("The query was turned clockwise by %d degrees to match.\n", 90 * matched.quarter_turns);
    if (geometry.status == TwoViewStatus::kTooFewMatches) {
      std::cout << "No pose. Next: antipode pose with the same options also knows what the other sides may look like.\n";
      return;
    }
    std::cout << Formatted("rotation %.1f degrees, deviation %.1f degrees\n",
                           RotationAngleDeg(geometry.query_from_reference.rotation),
                           std::min(geometry.RotationDeviationDeg(), 180.0));
    if (picture_) {
      std::cout << "Picture: " << *picture_ << "\n";
    } else {
      std::cout << "Next: add --visualize matches.png to see them, or --json matches.json to use them.\n";
    }
  }

  PhotographRequest reference_, query_;
  std::string matcher_ = "xfeat-lighterglue";
  int size_ = TwoViewPoseOptions().matching_size;
  ViewMatchingOptions options_;
  std::optional<std::string> picture_;
  CommonOptions common_;
};

}  // namespace

std::unique_ptr<Command> MakeMatchCommand() { return std::make_unique<MatchCommand>(); }

}  // namespace antipode
