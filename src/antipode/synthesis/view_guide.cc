#include "antipode/synthesis/view_guide.h"

#include <vector>

#include "antipode/prior/code_maps.h"
#include "antipode/util/error.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

constexpr char kPrior[] = "guide_prior", kHash[] = "guide_prior_sha256";

}  // namespace

ViewGuide::ViewGuide(const std::string& prior, torch::Device device)
    : name_(prior), sha256_(FindModel(prior).sha256), prior_(ObjectPrior::Load(prior, device)) {}

std::optional<ViewGuide> ViewGuide::Of(const std::map<std::string, std::string>& metadata, const std::string& source, torch::Device device) {
  const auto prior = metadata.find(kPrior);
  if (prior == metadata.end()) return std::nullopt;
  const auto hash = metadata.find(kHash);
  if (hash == metadata.end() || hash->second != FindModel(prior->second).sha256)
    throw BadFile(source, "was trained with another prior than the installed '" + prior->second + "'", "train it again with 'antipode train views'");
  return ViewGuide(prior->second, device);
}

std::map<std::string, std::string> ViewGuide::ToMetadata() const { return {{kPrior, name_}, {kHash, sha256_}}; }

int ViewGuide::Channels() const {
  const int size = PictureSize();
  return 2 * static_cast<int>(Encode(torch::ones({1, 3, size, size})).size(1));
}

torch::Tensor ViewGuide::Maps(const torch::Tensor& codes, std::span<const ViewCondition> views, int size) const {
  std::vector<Eigen::Matrix3d> rotations;
  for (const ViewCondition& view : views) rotations.push_back(view.view_from_picture);
  return CodeMaps(codes.expand({static_cast<std::int64_t>(views.size()), -1, -1}), rotations, size);
}

}  // namespace antipode
