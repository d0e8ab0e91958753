#include "antipode/synthesis/view_guide.h"

#include <gtest/gtest.h>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

TEST(ViewGuide, IsFoundAgainByWhatAModelRemembers) {
  const ViewGuide guide("prior");
  const auto found = ViewGuide::Of(guide.ToMetadata(), "a model");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->ToMetadata(), guide.ToMetadata());
  EXPECT_FALSE(ViewGuide::Of({}, "a model without guide"));
}

TEST(ViewGuide, OfAnotherPriorIsRefused) {
  std::map<std::string, std::string> metadata = ViewGuide("prior").ToMetadata();
  metadata.at("guide_prior_sha256")[0] ^= 1;
  EXPECT_THROW(ViewGuide::Of(metadata, "a model"), BadFile);
}

TEST(ViewGuide, ShowsOneCodeToManyViews) {
  const ViewGuide guide("prior");
  torch::manual_seed(1);
  const torch::Tensor code = guide.Encode(torch::rand({1, 3, guide.PictureSize(), guide.PictureSize()}));
  const std::vector<ViewCondition> views{{Eigen::Matrix3d::Identity(), {}}, {RotationAboutY(1.5), {}}};
  const torch::Tensor maps = guide.Maps(code, views, 16);
  EXPECT_EQ(maps.sizes(), torch::IntArrayRef({2, guide.Channels(), 16, 16}));
  EXPECT_FALSE(torch::allclose(maps[0], maps[1]));
}

}  // namespace
}  // namespace antipode
