#include "gen6d_kinds.h"

#include <cmath>
#include <regex>
#include <string>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "antipode/gen6d/losses.h"
#include "antipode/gen6d/normalized_view.h"
#include "antipode/gen6d/vgg11.h"
#include "antipode/gen6d/view_set.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"
#include "stored_items.h"
#include "stored_pictures.h"
#include "torch_tensors.h"

namespace antipode::golden {
namespace {

using torch::Tensor;

/// Every N-th channel, where a text of the configuration such as "corr_feats: channels 0,8,16,.." says so.
Tensor Thinned(const Tensor& tensor, std::int64_t channels_listed) {
  return tensor.slice(1, 0, c10::nullopt, std::max<std::int64_t>(1, tensor.size(1) / channels_listed));
}

std::int64_t ChannelsListed(const GoldenCase& golden_case, const std::string& name, std::int64_t otherwise) {
  for (const TensorSpec& spec : golden_case.specs)
    if (spec.name == name) return spec.attributes.at("shape").at(1);
  return otherwise;
}

Selector SyntheticSelector() {
  Selector selector;
  FillSynthetic(*selector);
  return selector;
}

Refiner SyntheticRefiner() {
  Refiner refiner;
  FillSynthetic(*refiner);
  return refiner;
}

NumericTensors BackboneStages(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  Vgg11 network;
  FillSynthetic(*network, "backbone.");
  const auto stages = network->forward(GeneratedTensor(golden_case, "img"));
  NumericTensors result;
  for (std::size_t i = 0; i < stages.size(); ++i) {
    const std::string name = "stage" + std::to_string(i);
    result[name] = FromTorchTensor(stages[i].slice(1, 0, ChannelsListed(golden_case, name, stages[i].size(1))));
  }
  result["pooled"] = FromTorchTensor(at::max_pool2d(stages.back(), 2));
  return result;
}

NumericTensors SelectorAttention(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  const Selector selector = SyntheticSelector();
  const Tensor x = GeneratedTensor(golden_case, "x");
  const Tensor message = selector->Attend(0, x);
  const Tensor mixed = selector->Mix(0, x, message);
  return {{"att0", FromTorchTensor(message)},
          {"mlp0", FromTorchTensor(mixed)},
          {"att1_on_sum", FromTorchTensor(selector->Attend(1, mixed + x))}};
}

NumericTensors SelectorCorrelations(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  const Selector selector = SyntheticSelector();
  NumericTensors result;
  for (std::size_t level = 0; level < 3; ++level) {
    const std::string number = std::to_string(level);
    const Tensor views = GeneratedTensor(golden_case, "x" + number)[0].transpose(0, 1);  // [D, C, h, w]
    result["corr" + number] = FromTorchTensor(selector->Correlate(level, views).transpose(0, 1).unsqueeze(0));
  }
  return result;
}

std::vector<Eigen::Vector3d> CameraCentres(const NumericTensor& poses) {
  std::vector<Eigen::Vector3d> centres;
  for (std::int64_t i = 0; i < ItemCount(poses); ++i) centres.push_back(Pose(poses, i).OriginInSource());
  return centres;
}

NumericTensors SelectorForward(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  Selector selector = SyntheticSelector();
  const Tensor references = GeneratedTensor(golden_case, "ref_imgs").transpose(0, 1).flatten(0, 1);  // view-major
  const SelectorFeatures query = selector->Features(GeneratedTensor(golden_case, "que_imgs"));
  const Tensor viewpoints =
      ViewpointVectors(CameraCentres(golden_case.Stored("ref_poses")), Item<3, 1>(golden_case.Stored("object_center"), 0),
                       Item<3, 1>(golden_case.Stored("object_vert"), 0));
  std::map<std::string, std::vector<Tensor>> shown;
  const Observation observation([&](const std::string& name, const Tensor& tensor) {
    shown[name].push_back(name == "corr_feats" || name == "score_process"
                              ? Thinned(tensor, ChannelsListed(golden_case, name, tensor.size(1)))
                              : tensor);
  });
  const SelectorOutput output = selector->forward(query, selector->Features(references), viewpoints, observation);
  NumericTensors result{{"logits", FromTorchTensor(output.logits)},
                        {"angles", FromTorchTensor(output.angles)},
                        {"ref_idx", FromTorchTensor(output.logits.argmax(1))}};
  for (const auto& [name, parts] : shown) result[name] = FromTorchTensor(at::cat(parts));
  for (std::size_t level = 0; level < query.size(); ++level) {
    const std::string name = "que_feat" + std::to_string(level) + "_sub";
    result[name] = FromTorchTensor(Thinned(query[level], ChannelsListed(golden_case, name, query[level].size(1))));
  }
  return result;
}

NumericTensors RefinerFeatures(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  return {{"feats", FromTorchTensor(SyntheticRefiner()->Features(GeneratedTensor(golden_case, "img")))}};
}

PosedCamera CameraAt(const NumericTensor& intrinsics, const NumericTensor& poses, std::int64_t index) {
  return {Item<3, 3>(intrinsics, index), Pose(poses, index)};
}

struct RefinerCase {
  Tensor query, references;  // [1, C, h, w], [1, R, C, h, w]
  PosedCamera input;
  std::vector<PosedCamera> cameras;
};

RefinerCase FeaturesOf(const GoldenCase& golden_case, Refiner& refiner) {
  RefinerCase result;
  result.query = refiner->Features(GeneratedTensor(golden_case, "que_img"));
  result.references = refiner->Features(GeneratedTensor(golden_case, "ref_imgs")[0]).unsqueeze(0);
  result.input = CameraAt(golden_case.Stored("que_K"), golden_case.Stored("que_pose_in"), 0);
  for (std::int64_t i = 0; i < result.references.size(1); ++i)
    result.cameras.push_back(CameraAt(golden_case.Stored("ref_Ks"), golden_case.Stored("ref_poses"), i));
  return result;
}

NumericTensors RefinerVolume(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  Refiner refiner(RefinerConfig{.grid = golden_case.config.at("sample_num")});
  FillSynthetic(*refiner);
  const RefinerCase inputs = FeaturesOf(golden_case, refiner);
  const auto volume = refiner->BuildVolume(inputs.input, inputs.references[0], inputs.cameras);
  const std::int64_t grid = refiner->config().grid;
  return {{"mean", FromTorchTensor(volume.mean.unsqueeze(0))},
          {"std", FromTorchTensor(volume.deviation.unsqueeze(0))},
          {"que", FromTorchTensor(refiner->QueryIn(volume, inputs.query[0], inputs.input).unsqueeze(0))},
          {"coords", FromTorchTensor(volume.points.view({1, grid, grid, grid, 3}))}};
}

/// Every 8th voxel along each axis.
Tensor EveryEighth(const Tensor& volume) {
  Tensor result = volume;
  for (int axis = 2; axis < 5; ++axis) result = result.slice(axis, 0, c10::nullopt, 8);
  return result;
}

/// Every 997th point of the volume in the input camera's frame.
Tensor GridPoints(const PosedCamera& input, std::int64_t grid) {
  const Tensor points = VolumePoints(input.camera_from_object, grid).to(torch::kDouble);
  std::vector<double> moved;
  for (std::int64_t i = 0; i < points.size(0); i += 997) {
    const Eigen::Vector3d point(points[i][0].item<double>(), points[i][1].item<double>(), points[i][2].item<double>());
    const Eigen::Vector3d in_camera = input.camera_from_object * point;
    moved.insert(moved.end(), in_camera.data(), in_camera.data() + 3);
  }
  return torch::tensor(moved, torch::kDouble).view({1, -1, 3});
}

NumericTensors RefinerForward(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  Refiner refiner(RefinerConfig{.grid = golden_case.config.at("sample_num")});
  FillSynthetic(*refiner);
  const RefinerCase inputs = FeaturesOf(golden_case, refiner);
  NumericTensors result;
  const Observation observation([&](const std::string& name, const Tensor& tensor) {
    if (name == "volume_out") {
      result[name] = FromTorchTensor(tensor);
      return;
    }
    result[name + "_sub"] = FromTorchTensor(EveryEighth(tensor));
    result[name + "_channel_mean"] = FromTorchTensor(tensor.to(torch::kDouble).mean({2, 3, 4}));
  });
  const RefinerOutput output = refiner->forward(inputs.query, {inputs.input}, inputs.references, {inputs.cameras}, observation);
  result["rotation"] = FromTorchTensor(output.rotation);
  result["offset"] = FromTorchTensor(output.offset);
  result["scale"] = FromTorchTensor(output.scale);
  result["grids_sub"] = FromTorchTensor(GridPoints(inputs.input, refiner->config().grid));
  return result;
}

NumericTensors SelectionLosses(const GoldenCase& golden_case) {
  const auto stored = [&](const char* name) { return StoredTensor(golden_case, name); };
  return {{"loss_score", FromTorchTensor(ViewSelectionLoss(stored("logits"), stored("scores_gt")))},
          {"loss_angle", FromTorchTensor(InPlaneAngleLoss(stored("angles_pr"), stored("angles_gt"),
                                                          stored("gt_ref_ids").to(torch::kLong)))}};
}

NumericTensors RefinerLosses(const GoldenCase& golden_case) {
  const auto stored = [&](const char* name) { return StoredTensor(golden_case, name); };
  const Tensor poses = stored("poses_in"), centres = poses.select(2, 3);
  const Tensor points = at::matmul(stored("object_points"), poses.slice(2, 0, 3).transpose(1, 2)) + centres.unsqueeze(1);
  const RefinerOutput output{stored("rotation"), stored("offset"), stored("scale")};
  return {{"loss_pose", FromTorchTensor(PoseChangeLoss(output, points, centres, stored("sim_gt")))}};
}

NumericTensors QueryDetections(const GoldenCase& golden_case) {
  const NumericTensor& images = golden_case.Stored("images");
  const std::int64_t count = ItemCount(images);
  NumericTensors result{{"position", NumericTensor({count, 2})}, {"scale", NumericTensor({count})}};
  for (std::int64_t i = 0; i < count; ++i) {
    const cv::Mat picture = Picture(images, i);
    const QueryCrop crop = PublishedQueryCrop(NonWhiteBoxOf(picture), picture.cols, golden_case.config.value("target", 128),
                                              golden_case.config.value("margin", 0.1));
    Append(result["position"], crop.position);
    Append(result["scale"], {crop.scale});
  }
  return result;
}

NumericTensors SelectedPoses(const GoldenCase& golden_case) {
  const auto& poses = golden_case.Stored("ref_pose");
  const std::int64_t count = ItemCount(poses);
  NumericTensors result{{"pose", NumericTensor({count, 3, 4})}};
  for (std::int64_t i = 0; i < count; ++i) {
    const QueryCrop crop{Item<2, 1>(golden_case.Stored("position"), i), Number(golden_case.Stored("scale"), i)};
    Append(result["pose"],
           PoseFromSelectedView(crop, Number(golden_case.Stored("angle"), i), Pose(poses, i), Item<3, 3>(golden_case.Stored("ref_K"), i),
                                Item<3, 3>(golden_case.Stored("que_K"), i), Item<3, 1>(golden_case.Stored("centre"), i),
                                LookAtForm::kPublished)
               .Matrix());
  }
  return result;
}

NumericTensors RefinedPoses(const GoldenCase& golden_case) {
  const auto& poses = golden_case.Stored("pose_in");
  const std::int64_t count = ItemCount(poses);
  NumericTensors result{{"similarity", NumericTensor({count, 3, 4})},
                        {"rigid", NumericTensor({count, 3, 4})},
                        {"final", NumericTensor({count, 3, 4})}};
  for (std::int64_t i = 0; i < count; ++i) {
    const Eigen::Vector4d q = Item<4, 1>(golden_case.Stored("quat"), i);
    const PoseChange change{Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix(),
                            Number(golden_case.Stored("scale"), i), Item<2, 1>(golden_case.Stored("offset"), i)};
    const Eigen::Vector3d centre = Item<3, 1>(golden_case.Stored("centre"), i);
    const Rigid3 rigid = ApplyChange(change, Pose(poses, i), centre);
    Append(result["similarity"], SimilarityOf(change, Pose(poses, i), centre));
    Append(result["rigid"], rigid.Matrix());
    Append(result["final"], (Pose(golden_case.Stored("rect"), i).Inverse() * rigid).Matrix());
  }
  return result;
}

NormalizationOptions PublishedNormalization(const nlohmann::json& config) {
  NormalizationOptions options;
  options.look_at = LookAtForm::kPublished;
  options.size = config.value("size", options.size);
  options.margin = config.value("margin", options.margin);
  return options;
}

NumericTensors NormalizedReferences(const GoldenCase& golden_case) {
  const auto& poses = golden_case.Stored("poses");
  const auto& intrinsics = golden_case.Stored("Ks");
  const NormalizationOptions options = PublishedNormalization(golden_case.config);
  const Eigen::Matrix3d input_intrinsics = Item<3, 3>(golden_case.Stored("input_K"), 0);
  const Rigid3 input_pose = Pose(golden_case.Stored("input_pose"), 0);
  const std::int64_t count = ItemCount(poses);
  NumericTensors result{{"align_angle", NumericTensor({count})}, {"scale_difference", NumericTensor({count})}};
  for (const char* form : {"upright", "aligned"}) {
    result[std::string(form) + "_K"] = NumericTensor({count, 3, 3});
    result[std::string(form) + "_pose"] = NumericTensor({count, 3, 4});
    result[std::string(form) + "_H"] = NumericTensor({count, 3, 3});
  }
  const auto add = [&](const std::string& form, const NormalizedView& view) {
    Append(result[form + "_K"], view.intrinsics);
    Append(result[form + "_pose"], view.camera_from_object.Matrix());
    Append(result[form + "_H"], view.normalized_pixel_from_pixel);
  };
  for (std::int64_t i = 0; i < count; ++i) {
    const Eigen::Matrix3d k = Item<3, 3>(intrinsics, i);
    add("upright", NormalizeUpright(k, Pose(poses, i), options));
    add("aligned", NormalizeAligned(k, Pose(poses, i), input_intrinsics, input_pose, options));
    const auto difference = InPlaneDifferenceOf(k, Pose(poses, i), input_intrinsics, input_pose, options.look_at);
    Append(result["align_angle"], {difference.angle});
    Append(result["scale_difference"], {difference.scale});
  }
  return result;
}

std::vector<Rigid3> Poses(const NumericTensor& stored) {
  std::vector<Rigid3> poses;
  for (std::int64_t i = 0; i < ItemCount(stored); ++i) poses.push_back(Pose(stored, i));
  return poses;
}

NumericTensors RefinementNeighbours(const GoldenCase& golden_case) {
  const std::vector<Rigid3> views = Poses(golden_case.Stored("poses"));
  const std::vector<Rigid3> queries = Poses(golden_case.Stored("query_poses"));
  const std::size_t count = golden_case.config.value("k", 6);
  const auto pool = golden_case.config.value("even", true) ? NeighbourPool::kPublished : NeighbourPool::kAll;
  NumericTensor ids({static_cast<std::int64_t>(queries.size()), static_cast<std::int64_t>(count)});
  for (const Rigid3& query : queries)
    for (const std::size_t index : NearestViews(views, query, count, pool)) Append(ids, {static_cast<double>(index)});
  return {{"ids", ids}};
}

NumericTensors TrainingTargets(const GoldenCase& golden_case) {
  const auto& inputs = golden_case.Stored("pose_in");
  const auto& queries = golden_case.Stored("pose_que");
  const std::int64_t count = ItemCount(inputs);
  NumericTensors result{{"sim", NumericTensor({count, 3, 4})},       {"scale", NumericTensor({count})},
                        {"quaternion", NumericTensor({count, 4})},   {"offset", NumericTensor({count, 3})},
                        {"selector_scale_r2q", NumericTensor({count})}, {"selector_angle_r2q", NumericTensor({count})},
                        {"view_cosine", NumericTensor({count, count})}};
  for (std::int64_t i = 0; i < count; ++i) {
    const Eigen::Matrix3d input_k = Item<3, 3>(golden_case.Stored("K_in"), i), query_k = Item<3, 3>(golden_case.Stored("K_que"), i);
    const PoseChange change = ChangeBetween(input_k, Pose(inputs, i), query_k, Pose(queries, i));
    Eigen::Quaterniond q(change.rotation);
    if (q.w() < 0) q.coeffs() *= -1;
    const auto difference = InPlaneDifferenceOf(input_k, Pose(inputs, i), query_k, Pose(queries, i), LookAtForm::kPublished);
    Append(result["sim"], SimilarityOf(change, Pose(inputs, i)));
    Append(result["scale"], {change.scale});
    Append(result["quaternion"], {q.w(), q.x(), q.y(), q.z()});
    Append(result["offset"], {change.offset.x(), change.offset.y(), 0});
    Append(result["selector_scale_r2q"], {difference.scale});
    Append(result["selector_angle_r2q"], {difference.angle});
    for (std::int64_t j = 0; j < count; ++j)
      Append(result["view_cosine"], {Pose(queries, i).OriginInSource().normalized().dot(Pose(inputs, j).OriginInSource().normalized())});
  }
  return result;
}

/// "fcr/fct/fcs weight and bias are multiplied by X and then Y is added to regressor.fcr.bias[0]".
void DampUpdates(RefinerImpl& refiner, const std::string& description) {
  std::smatch factor, summand;
  if (!std::regex_search(description, factor, std::regex("multiplied by ([0-9.]+)"))) return;
  const torch::NoGradGuard no_gradient;
  for (auto& parameter : refiner.named_parameters()) {
    const std::string& name = parameter.key();
    if (!name.starts_with("regressor.fc") || name.starts_with("regressor.fc.")) continue;
    parameter.value().mul_(std::stof(factor[1]));
    if (name == "regressor.fcr.bias" && std::regex_search(description, summand, std::regex("([0-9.]+) is added")))
      parameter.value()[0] += std::stof(summand[1]);
  }
}

std::vector<PosedPicture> PosedPictures(const GoldenCase& golden_case) {
  std::vector<PosedPicture> views;
  const NumericTensor& pictures = golden_case.Stored("view_images");
  for (std::int64_t i = 0; i < ItemCount(pictures); ++i)
    views.push_back({Picture(pictures, i), Item<3, 3>(golden_case.Stored("view_Ks"), i), Pose(golden_case.Stored("view_poses"), i)});
  return views;
}

/// Adds the cameras, views and changes of each iteration, and its pictures at the stored poses: a grey level says more
/// about the warp there than where three iterations have led.
void AddIterations(NumericTensors& result, const GoldenCase& golden_case, const std::vector<PosedPicture>& views,
                   const QueryPicture& query, const std::vector<Rigid3>& poses, Refiner& refiner,
                   const ViewMatchingConventions& conventions) {
  for (std::size_t k = 0; k + 1 < poses.size(); ++k) {
    const std::string prefix = "it" + std::to_string(k) + "_";
    const RefinementInput input = PrepareRefinement(views, query, poses[k], conventions);
    const auto count = static_cast<std::int64_t>(input.views.size());
    result[prefix + "que_K"] = Matrix(input.query.intrinsics);
    result[prefix + "que_pose_in"] = Matrix(input.query.camera_from_object.Matrix());
    NumericTensor intrinsics({count, 3, 3}), cameras({count, 3, 4}), ids({count});
    for (std::int64_t i = 0; i < count; ++i) {
      Append(intrinsics, input.references[i].intrinsics);
      Append(cameras, input.references[i].camera_from_object.Matrix());
      Append(ids, {static_cast<double>(input.views[i])});
    }
    result[prefix + "ref_K"] = intrinsics;
    result[prefix + "ref_pose"] = cameras;
    result[prefix + "ref_ids"] = ids;
    const auto stored = PrepareRefinement(views, query, Pose(golden_case.Stored("refine_poses"), static_cast<std::int64_t>(k)), conventions);
    result[prefix + "que_img"] = ChannelsFirst({stored.query_picture}, FirstAxis::kWithout);
    result[prefix + "ref_imgs"] = ChannelsFirst(stored.reference_pictures, FirstAxis::kWith);
    const PoseChange change = PredictChanges(refiner, {input}).front();
    const Eigen::Quaterniond q(change.rotation);
    result[prefix + "rotation"] = Vector({q.w(), q.x(), q.y(), q.z()});
    result[prefix + "offset"] = Vector({change.offset.x(), change.offset.y()});
    result[prefix + "scale"] = Vector({std::log2(change.scale)});
  }
}

NumericTensors ViewMatching(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  const auto conventions = ViewMatchingConventions::Published();
  const std::vector<PosedPicture> views = PosedPictures(golden_case);
  const cv::Mat photograph = Picture(golden_case.Stored("query_full_image"), -1);
  const auto look_at = published::LookAtBox(Item<3, 3>(golden_case.Stored("query_full_K"), 0), Box(golden_case.Stored("query_bbox"), 0));
  const QueryPicture query{WarpPicture(photograph, look_at.virtual_pixel_from_pixel, look_at.size, 255), look_at.intrinsics};
  NumericTensors result{{"query_virtual_image", ChannelsLast({query.rgb}, FirstAxis::kWithout)},
                        {"query_virtual_K", Matrix(query.intrinsics)},
                        {"query_virtual_R", Matrix(look_at.virtual_from_camera)}};
  Rigid3 start;
  if (golden_case.Lists("initial_pose")) {
    start = Pose(golden_case.Stored("initial_pose"), 0);
  } else {
    Selector selector = SyntheticSelector();
    const SelectorReferences references = PrepareReferences(selector, views, conventions);
    const QueryCrop crop = PublishedQueryCrop(NonWhiteBoxOf(query.rgb), query.rgb.cols);
    const auto selected = SelectViews(selector, references, query, crop, conventions);
    start = selected.front().camera_from_object;
    NumericTensor logits({static_cast<std::int64_t>(views.size())});
    logits.values.resize(views.size());
    for (const SelectedPose& pose : selected) logits.values[pose.view] = pose.logit;
    const auto count = static_cast<std::int64_t>(views.size());
    NumericTensor intrinsics({count, 3, 3}), cameras({count, 3, 4});
    for (const NormalizedView& view : references.views) {
      Append(intrinsics, view.intrinsics);
      Append(cameras, view.camera_from_object.Matrix());
    }
    result["reference_K"] = intrinsics;
    result["reference_pose"] = cameras;
    result["reference_images_0_1"] = ChannelsLast({references.upright[0], references.upright[1]}, FirstAxis::kWith);
    result["reference_rotated_0"] = ChannelsLast(TurnedPictures(views[0], references.views[0], conventions), FirstAxis::kWith);
    result["query_crop"] = ChannelsLast({CropQuery(query.rgb, crop, conventions)}, FirstAxis::kWithout);
    result["detector_position"] = Vector({crop.position.x(), crop.position.y()});
    result["detector_scale"] = Scalar(crop.scale);
    result["logits"] = logits;
    result["selected"] = Scalar(static_cast<double>(selected.front().view));
    result["angle"] = Scalar(selected.front().angle);
  }
  Refiner refiner = SyntheticRefiner();
  DampUpdates(*refiner, golden_case.config.value("weights", ""));
  const auto poses = RefinePoses(refiner, views, query, {start}, golden_case.config.at("iterations"), conventions).front();
  NumericTensor history({static_cast<std::int64_t>(poses.size()), 3, 4});
  for (const Rigid3& pose : poses) Append(history, pose.Matrix());
  result["refine_poses"] = history;
  result["final_pose"] = Matrix(poses.back().Matrix());
  result["final_pose_camera"] = Matrix(published::CameraFromObject(look_at, poses.back()).Matrix());
  AddIterations(result, golden_case, views, query, poses, refiner, conventions);
  return result;
}

NumericTensors WarpedPicture(const GoldenCase& golden_case) {
  const auto look_at = published::LookAtBox(Item<3, 3>(golden_case.Stored("K"), 0), Box(golden_case.Stored("bbox"), 0));
  const double border = golden_case.config.value("border", 255);
  const cv::Mat picture = Picture(golden_case.Stored("image"), -1);
  return {{"warped", ChannelsLast({WarpPicture(picture, look_at.virtual_pixel_from_pixel, look_at.size, border)}, FirstAxis::kWithout)},
          {"exact_bilinear", ExactWarp(picture, look_at.virtual_pixel_from_pixel, look_at.size, border)}};
}

}  // namespace

std::vector<CatalogueEntry> Gen6dKinds() {
  return {{"vgg_backbone", {"stage0", "pooled"}, BackboneStages},
          {"selector_attention", {"att0", "att1_on_sum"}, SelectorAttention},
          {"selector_corr", {"corr0", "corr1"}, SelectorCorrelations},
          {"selector", {"logits", "angles", "ref_poses"}, SelectorForward},
          {"refiner_feature_net", {"feats"}, RefinerFeatures},
          {"refiner_volume", {"mean", "std", "coords"}, RefinerVolume},
          {"refiner_forward", {"volume_out", "rotation"}, RefinerForward},
          {"loss_selection", {"loss_score", "loss_angle"}, SelectionLosses},
          {"loss_refiner", {"loss_pose"}, RefinerLosses},
          {"geom_query_detector", {"images", "position", "scale"}, QueryDetections},
          {"geom_select_pose", {"position", "ref_pose", "pose"}, SelectedPoses},
          {"geom_refine_pose", {"quat", "similarity", "rigid"}, RefinedPoses},
          {"geom_normalize_reference", {"upright_K", "aligned_K"}, NormalizedReferences},
          {"geom_refine_neighbours", {"query_poses", "ids"}, RefinementNeighbours},
          {"geom_train_targets", {"pose_in", "pose_que", "sim"}, TrainingTargets},
          {"gen6d_pipeline", {"view_images", "logits", "selected"}, ViewMatching},
          {"gen6d_refine_once", {"view_images", "initial_pose"}, ViewMatching},
          {"warp_lookat", {"image", "K", "bbox", "warped"}, WarpedPicture}};
}

}  // namespace antipode::golden
