#include "loftr_kinds.h"

#include <cstdint>
#include <regex>
#include <string>

#include "antipode/matching/loftr.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"
#include "torch_tensors.h"

namespace antipode::golden {
namespace {

/// [H, W], [1, H, W] or [1, 1, H, W] -> [1, 1, H, W].
torch::Tensor StoredImage(const GoldenCase& golden_case, const std::string& name) {
  const NumericTensor& image = golden_case.Stored(name);
  if (image.shape.size() < 2) throw Error(name, "is no image");
  return torch::tensor(image.values, torch::kDouble)
      .view({1, 1, image.shape[image.shape.size() - 2], image.shape.back()})
      .to(torch::kFloat);
}

LoftrOptions OptionsOf(const nlohmann::json& config) {
  LoftrOptions options;
  options.min_confidence = config.value("thr", options.min_confidence);
  options.border = config.value("border_rm", options.border);
  if (!config.value("temp_bug_fix", true)) options.position_code = LoftrPositionCode::kFloored;
  return options;
}

/// Which part of a tensor is stored, as the text `subsampling` of the configuration says.
struct Subsampling {
  std::int64_t token_step = 1, channel_step = 1, matches = -1;

  static Subsampling Of(const nlohmann::json& config) {
    const std::string text = config.value("subsampling", "");
    Subsampling subsampling;
    subsampling.token_step = NumberIn(text, R"(tokens 0,(\d+))", 1);
    subsampling.channel_step = NumberIn(text, R"(channels 0,(\d+))", 1);
    subsampling.matches = NumberIn(text, R"(first (\d+) matches)", -1);
    return subsampling;
  }

  torch::Tensor OfTokens(const torch::Tensor& tokens) const {
    return tokens.slice(1, 0, c10::nullopt, token_step);
  }
  torch::Tensor OfChannels(const torch::Tensor& map) const {
    return map.slice(1, 0, c10::nullopt, channel_step);
  }
  torch::Tensor OfWindows(const torch::Tensor& windows) const {
    return matches < 0 ? windows : windows.slice(0, 0, matches);
  }

 private:
  static std::int64_t NumberIn(const std::string& text, const char* pattern,
                               std::int64_t otherwise) {
    std::smatch match;
    return std::regex_search(text, match, std::regex(pattern)) ? std::stoll(match[1]) : otherwise;
  }
};

std::map<std::string, torch::Tensor> NamedTensors(const LoftrOutput& output,
                                                  const Subsampling& part) {
  return {{"backbone_coarse0", output.first_features.coarse},
          {"backbone_coarse1", output.second_features.coarse},
          {"backbone_fine0", output.first_features.fine},
          {"backbone_fine1", output.second_features.fine},
          {"backbone_fine0_sub", part.OfChannels(output.first_features.fine)},
          {"backbone_fine1_sub", part.OfChannels(output.second_features.fine)},
          {"coarse_in0", part.OfTokens(output.coarse_input.first)},
          {"coarse_in1", part.OfTokens(output.coarse_input.second)},
          {"coarse0", part.OfTokens(output.coarse.first)},
          {"coarse1", part.OfTokens(output.coarse.second)},
          {"fine_in0", part.OfWindows(output.fine_input.first)},
          {"fine_in1", part.OfWindows(output.fine_input.second)},
          {"fine0", part.OfWindows(output.fine.first)},
          {"fine1", part.OfWindows(output.fine.second)},
          {"conf_matrix", output.confidence.unsqueeze(0)},
          {"i_ids", output.pairs.first},
          {"j_ids", output.pairs.second},
          {"mconf", output.pairs.confidences},
          {"mkpts0_c", output.first_points},
          {"mkpts1_c", output.second_cell_points},
          {"expec_f", torch::cat({output.offsets, output.deviations.unsqueeze(1)}, 1)},
          {"mkpts0_f", output.first_points},
          {"mkpts1_f", output.second_points}};
}

NumericTensors MatchedImages(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  Loftr network;
  FillSynthetic(*network);
  const LoftrOutput output =
      network->forward(StoredImage(golden_case, "image0"), StoredImage(golden_case, "image1"),
                       OptionsOf(golden_case.config));
  NumericTensors result;
  for (const auto& [name, tensor] : NamedTensors(output, Subsampling::Of(golden_case.config)))
    result[name] = FromTorchTensor(tensor);
  return result;
}

NumericTensors PositionCodes(const GoldenCase& golden_case) {
  const nlohmann::json& config = golden_case.config;
  const int channels = config.value("d_model", 256);
  const int rows = config.at("rows"), columns = config.at("cols");
  return {{"pe_fix_1",
           FromTorchTensor(PositionCode(LoftrPositionCode::kCorrected, channels, rows, columns))},
          {"pe_fix_0",
           FromTorchTensor(PositionCode(LoftrPositionCode::kFloored, channels, rows, columns))}};
}

}  // namespace

std::vector<CatalogueEntry> LoftrKinds() {
  return {{"loftr", {"image0", "image1", "conf_matrix"}, MatchedImages},
          {"loftr_posenc", {"pe_fix_1"}, PositionCodes}};
}

}  // namespace antipode::golden
