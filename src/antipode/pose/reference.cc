#include "antipode/pose/reference.h"

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "antipode/nn/module_weights.h"
#include "antipode/synthesis/pose_json.h"
#include "antipode/synthesis/view_folder.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/version.h"
#include "antipode/weights/safetensors.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kFormat = 1;
constexpr std::size_t kFewestViews = 8;
constexpr std::size_t kEncodedAtOnce = 16;
constexpr int kCropSize = 256;
constexpr char kInfoFile[] = "reference.json";
constexpr char kFeaturesFile[] = "features.safetensors";
constexpr char kBuildAgain[] = "build it again: antipode reference build";

bool ShowsObject(const cv::Mat& mask) {
  const int pixels = cv::countNonZero(mask);
  return pixels > 16 && pixels < static_cast<int>(mask.total());
}

/// Leaves out the pictures that show nothing.
/// @return the masks of the others
std::vector<cv::Mat> DropEmptyViews(Reference& reference) {
  std::vector<SynthesizedView> kept;
  std::vector<cv::Mat> masks;
  for (SynthesizedView& view : reference.views) {
    const cv::Mat mask = MaskOnWhite(view.image);
    if (!ShowsObject(mask)) {
      reference.warnings.push_back("view " + view.request.name + " shows no object and is left out");
      continue;
    }
    masks.push_back(mask);
    kept.push_back(std::move(view));
  }
  reference.views = std::move(kept);
  return masks;
}

/// The crops that matching compares.
void CropViews(const std::vector<cv::Mat>& masks, Reference& reference) {
  for (std::size_t i = 0; i < masks.size(); ++i)
    reference.crops.push_back(MakeObjectView(reference.views[i].image, masks[i], reference.views[i].camera, {.size = kCropSize}));
}

}  // namespace

cv::Mat MaskOnWhite(const cv::Mat& picture) {
  std::vector<cv::Mat> channels;
  cv::split(picture, channels);
  const cv::Mat darkest = cv::min(channels[0], cv::min(channels[1], channels[2]));
  cv::Mat mask = darkest < 250;
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(mask, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_SIMPLE);
  cv::drawContours(mask, outlines, -1, cv::Scalar(255), cv::FILLED);
  return mask;
}

Reference MakeReference(std::vector<SynthesizedView> views, const ObjectPrior& prior,
                        const std::optional<Rigid3>& source_from_object, const ProgressCallback& progress) {
  Reference reference;
  reference.views = std::move(views);
  reference.source_from_object = source_from_object;
  const std::vector<cv::Mat> masks = DropEmptyViews(reference);
  if (reference.views.size() < kFewestViews)
    throw Error("reference", "has only " + std::to_string(reference.views.size()) + " views that show the object",
                "at least 8 are needed; ask for more with --views");
  CropViews(masks, reference);
  std::vector<torch::Tensor> codes;
  std::vector<Eigen::Matrix3d> rotations;
  std::vector<ObjectView> batch;
  for (std::size_t i = 0; i < reference.views.size(); ++i) {
    if (progress) progress({"encoding views", static_cast<std::int64_t>(i), static_cast<std::int64_t>(reference.views.size()), {}});
    const SynthesizedView& view = reference.views[i];
    batch.push_back(MakeObjectView(view.image, masks[i], view.camera, prior.ViewOptions()));
    rotations.push_back(batch.back().crop_from_camera * view.camera_from_object.rotation);
    if (batch.size() < kEncodedAtOnce && i + 1 < reference.views.size()) continue;
    codes.push_back(prior.Encode(batch));
    batch.clear();
  }
  reference.code = prior.JoinViews(torch::cat(codes), rotations);
  return reference;
}

void SaveReference(const fs::path& folder, const Reference& reference, const PriorIdentity& prior, const std::string& fingerprint) {
  TensorFile features;
  features.tensors["code"] = FromTorch(reference.code);
  WriteSafetensors(folder / kFeaturesFile, features);
  Json json = {{"antipode", Version()},
               {"format", kFormat},
               {"fingerprint", fingerprint},
               {"prior_sha256", prior.sha256},
               {"features_sha256", Sha256OfFile(folder / kFeaturesFile)},
               {"views_sha256", Sha256OfFile(folder / "views.json")},
               {"views", reference.views.size()},
               {"length_unit", "object radius"},
               {"warnings", reference.warnings}};
  if (reference.source_from_object) json["source_from_object"] = PoseToJson(*reference.source_from_object);
  WriteFileAtomically(folder / kInfoFile, json.dump(2) + "\n");
}

bool IsReferenceFolder(const fs::path& folder) { return fs::is_directory(folder) && fs::exists(folder / kInfoFile); }

namespace {

Json ReadInfoJson(const fs::path& folder) {
  const fs::path file = folder / kInfoFile;
  if (!fs::exists(file)) throw BadFile(file.string(), "is missing: this is no finished reference", kBuildAgain);
  try {
    Json json = Json::parse(ReadFile(file));
    if (json.at("format") != kFormat)
      throw BadFile(file.string(), "was written by another version of antipode (" + json.at("antipode").get<std::string>() + ")", kBuildAgain);
    return json;
  } catch (const Json::exception&) {
    throw BadFile(file.string(), "is damaged", kBuildAgain);
  }
}

ReferenceInfo InfoFrom(const Json& json, const fs::path& folder) {
  try {
    ReferenceInfo info{json.at("antipode"), json.at("fingerprint"), json.at("prior_sha256"), json.at("views"), {}, json.at("warnings")};
    if (json.contains("source_from_object")) info.source_from_object = PoseFromJson(json.at("source_from_object"));
    return info;
  } catch (const Json::exception&) {
    throw BadFile((folder / kInfoFile).string(), "is damaged", kBuildAgain);
  }
}

}  // namespace

ReferenceInfo ReadReferenceInfo(const fs::path& folder) { return InfoFrom(ReadInfoJson(folder), folder); }

Reference LoadReference(const fs::path& folder, const PriorIdentity& prior) {
  const Json json = ReadInfoJson(folder);
  const ReferenceInfo info = InfoFrom(json, folder);
  for (const auto& [file, field] : {std::pair{kFeaturesFile, "features_sha256"}, {"views.json", "views_sha256"}}) {
    if (!fs::exists(folder / file) || json.value(field, "") != Sha256OfFile(folder / file))
      throw BadFile((folder / file).string(), "is missing or not what was written", kBuildAgain);
  }
  if (info.prior_sha256 != prior.sha256)
    throw BadFile(folder.string(), "was built with other weights of the prior", kBuildAgain);
  Reference reference;
  reference.views = ViewFolder::LoadAll(folder);
  reference.source_from_object = info.source_from_object;
  CropViews(DropEmptyViews(reference), reference);
  reference.warnings = info.warnings;
  if (static_cast<int>(reference.views.size()) != info.views)
    throw BadFile((folder / "views.json").string(), "lists another number of views", kBuildAgain);
  const TensorFile features = SafetensorsReader(folder / kFeaturesFile).ReadAll();
  const auto code = features.tensors.find("code");
  if (code == features.tensors.end()) throw BadFile((folder / kFeaturesFile).string(), "has no tensor 'code'", kBuildAgain);
  reference.code = ToTorch(code->second);
  return reference;
}

}  // namespace antipode
