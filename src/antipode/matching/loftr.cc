#include "antipode/matching/loftr.h"

#include <cmath>
#include <vector>

#include "antipode/nn/precision.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr int kCoarseChannels = 256, kFineChannels = 128;
constexpr int kCoarseLayers = 8, kFineLayers = 2;
constexpr int kCoarseStride = 8, kFineStride = 2;
constexpr int kWindow = 5, kWindowRadius = kWindow / 2, kWindowCentre = kWindow * kWindow / 2;
constexpr double kLeastVariance = 1e-10;

void CheckImage(const torch::Tensor& image) {
  const bool fits = image.dim() == 4 && image.size(0) == 1 && image.size(1) == 1 &&
                    image.size(2) % kCoarseStride == 0 && image.size(3) % kCoarseStride == 0 &&
                    image.numel() > 0;
  if (!fits)
    throw Error("LoFTR", "was given an image of another shape",
                "give [1, 1, H, W], H and W multiples of 8");
}

CellGrid GridOf(const torch::Tensor& map) { return {map.size(2), map.size(3)}; }

/// [1, C, H, W] -> [1, H W, C].
torch::Tensor Tokens(const torch::Tensor& map) {
  return map.flatten(2).transpose(1, 2).contiguous();
}

torch::Tensor RowOf(const torch::Tensor& cells, CellGrid grid) {
  return torch::floor_divide(cells, grid.columns);
}
torch::Tensor ColumnOf(const torch::Tensor& cells, CellGrid grid) {
  return torch::remainder(cells, grid.columns);
}

torch::Tensor IsWithin(const torch::Tensor& index, std::int64_t count, int border) {
  return (index >= border) & (index < count - border);
}

torch::Tensor IsInside(const torch::Tensor& cells, CellGrid grid, int border) {
  return IsWithin(RowOf(cells, grid), grid.rows, border) &
         IsWithin(ColumnOf(cells, grid), grid.columns, border);
}

torch::Tensor CoarseInput(const torch::Tensor& map, LoftrPositionCode variant) {
  const auto code = PositionCode(variant, kCoarseChannels, static_cast<int>(map.size(2)),
                                 static_cast<int>(map.size(3)));
  return Tokens(map + code.to(map.options()));
}

/// The points of cells, [M, 2], x first.
torch::Tensor PointsOf(const torch::Tensor& cells, CellGrid grid, torch::Dtype dtype) {
  return kCoarseStride * torch::stack({ColumnOf(cells, grid), RowOf(cells, grid)}, 1).to(dtype);
}

/// 5 x 5 elements of the fine map around the points of cells, zero beyond its edges: [M, 25, C],
/// row-major.
torch::Tensor Windows(const torch::Tensor& fine_map, const torch::Tensor& cells, CellGrid grid) {
  constexpr int kFinePerCell = kCoarseStride / kFineStride;
  const auto padded =
      torch::constant_pad_nd(fine_map[0].permute({1, 2, 0}),
                             {0, 0, kWindowRadius, kWindowRadius, kWindowRadius, kWindowRadius});
  const auto offsets = torch::arange(kWindow, cells.options());
  const auto rows = (kFinePerCell * RowOf(cells, grid)).view({-1, 1, 1}) + offsets.view({1, -1, 1});
  const auto columns =
      (kFinePerCell * ColumnOf(cells, grid)).view({-1, 1, 1}) + offsets.view({1, 1, -1});
  return padded.index({rows, columns}).flatten(1, 2);
}

/// (x, y) of the 25 elements of a window, in its halves: [25, 2].
torch::Tensor WindowGrid(const torch::TensorOptions& options) {
  const auto side = torch::linspace(-1, 1, kWindow, options);
  const auto yx = torch::meshgrid({side, side}, "ij");
  return torch::stack({yx[1].flatten(), yx[0].flatten()}, 1);
}

/// Where the centre token of the first window is in the second.
void LocateCentre(LoftrOutput& output) {
  const auto centre = output.fine.first.select(1, kWindowCentre).unsqueeze(-1);  // [M, C, 1]
  const auto similarity =
      torch::matmul(output.fine.second, centre).squeeze(-1) / std::sqrt(kFineChannels);
  const auto heat = torch::softmax(similarity, 1);  // [M, 25]
  const auto grid = WindowGrid(heat.options());
  output.offsets = torch::matmul(heat, grid);
  const auto variance = torch::matmul(heat, grid.square()) - output.offsets.square();
  output.deviations = variance.clamp_min(kLeastVariance).sqrt().sum(1);
}

}  // namespace

void LoftrOptions::Check() const {
  if (!(min_confidence >= 0 && min_confidence < 1))
    throw InvalidOption("min_confidence", "must be 0 to less than 1");
  if (border < 0) throw InvalidOption("border", "must not be negative");
}

torch::Tensor PositionCode(LoftrPositionCode variant, int channels, int rows, int columns) {
  const auto k = torch::arange(channels / 4, torch::kDouble);
  const double rate = variant == LoftrPositionCode::kFloored ? -2 : -4 * std::log(1e4) / channels;
  const auto frequencies = torch::exp(rate * k).view({-1, 1, 1});
  const auto x = torch::arange(1, columns + 1, torch::kDouble).view({1, 1, -1}) * frequencies;
  const auto y = torch::arange(1, rows + 1, torch::kDouble).view({1, -1, 1}) * frequencies;
  const std::vector<std::int64_t> plane = {channels / 4, rows, columns};
  const auto code = torch::stack(
      {x.sin().expand(plane), x.cos().expand(plane), y.sin().expand(plane), y.cos().expand(plane)},
      1);
  return code.flatten(0, 1).to(torch::kFloat);
}

torch::Tensor DualSoftmax(const torch::Tensor& first, const torch::Tensor& second,
                          double temperature) {
  const double scale = 1 / (static_cast<double>(first.size(1)) * temperature);
  const auto similarity = torch::matmul(first * scale, second.t());
  return torch::softmax(similarity, 0).mul_(torch::softmax(similarity, 1));
}

CellPairs SelectMutualMaxima(const torch::Tensor& confidence, CellGrid first, CellGrid second,
                             const LoftrOptions& options) {
  options.Check();
  const auto [row_maximum, nearest] = confidence.max(1);
  const auto column_maximum = std::get<0>(confidence.max(0));
  const auto cells = torch::arange(confidence.size(0), nearest.options());
  const auto is_match =
      (row_maximum == column_maximum.index({nearest})) & (row_maximum > options.min_confidence) &
      IsInside(cells, first, options.border) & IsInside(nearest, second, options.border);
  return {cells.index({is_match}), nearest.index({is_match}), row_maximum.index({is_match})};
}

LoftrImpl::LoftrImpl()
    : coarse_transformer_(kCoarseChannels, kCoarseLayers),
      fine_transformer_(kFineChannels, kFineLayers),
      down_projection_(kCoarseChannels, kFineChannels),
      merge_(2 * kFineChannels, kFineChannels) {
  register_module("backbone", backbone_);
  register_module("loftr_coarse", coarse_transformer_);
  register_module(
      "fine_preprocess",
      torch::nn::ModuleDict(torch::OrderedDict<std::string, std::shared_ptr<torch::nn::Module>>(
          {{"down_proj", down_projection_.ptr()}, {"merge_feat", merge_.ptr()}})));
  register_module("loftr_fine", fine_transformer_);
}

LoftrFeatures LoftrImpl::Features(const torch::Tensor& image, const LoftrOptions& options) const {
  const BFloat16Autocast autocast(image.device().type(), options.bfloat16_convolutions);
  const LoftrFeatures features = backbone_->forward(image);
  return {features.coarse.to(image.scalar_type()), features.fine.to(image.scalar_type())};
}

torch::Tensor LoftrImpl::FineInput(const LoftrFeatures& features, const torch::Tensor& coarse,
                                   const torch::Tensor& cells) {
  const auto windows = Windows(features.fine, cells, GridOf(features.coarse));
  const auto context = down_projection_(coarse[0].index({cells})).unsqueeze(1).expand_as(windows);
  return merge_(torch::cat({windows, context}, -1));
}

LoftrOutput LoftrImpl::forward(const torch::Tensor& first, const torch::Tensor& second,
                               const LoftrOptions& options) {
  options.Check();
  CheckImage(first);
  CheckImage(second);
  LoftrOutput output;
  output.first_features = Features(first, options);
  output.second_features = Features(second, options);
  const auto &first_map = output.first_features.coarse, &second_map = output.second_features.coarse;
  output.coarse_input = {CoarseInput(first_map, options.position_code),
                         CoarseInput(second_map, options.position_code)};
  output.coarse = coarse_transformer_->forward(output.coarse_input);
  output.confidence = DualSoftmax(output.coarse.first[0], output.coarse.second[0]);
  output.pairs =
      SelectMutualMaxima(output.confidence, GridOf(first_map), GridOf(second_map), options);
  output.fine_input = {
      FineInput(output.first_features, output.coarse.first, output.pairs.first),
      FineInput(output.second_features, output.coarse.second, output.pairs.second)};
  output.fine = fine_transformer_->forward(output.fine_input);
  LocateCentre(output);
  const auto dtype = output.offsets.scalar_type();
  output.first_points = PointsOf(output.pairs.first, GridOf(first_map), dtype);
  output.second_cell_points = PointsOf(output.pairs.second, GridOf(second_map), dtype);
  output.second_points = output.second_cell_points + kWindowRadius * kFineStride * output.offsets;
  return output;
}

}  // namespace antipode
