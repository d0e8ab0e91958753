#pragma once

#include <cstdint>

#include <torch/torch.h>

#include "antipode/matching/loftr_backbone.h"
#include "antipode/matching/loftr_transformer.h"

namespace antipode {

/// The frequencies w_k, k = 0..C/4 - 1, of the position code for C channels. Weights belong to the
/// one they were trained with.
enum class LoftrPositionCode {
  kCorrected,  ///< w_k = 10000^(-4k/C)
  kFloored,    ///< w_k = exp(-2k), by an integer division; of the older published weights
};

struct LoftrOptions {
  double min_confidence = 0.2;  ///< matches have more
  int border = 2;               ///< cells this near to an edge of either image are not matched
  LoftrPositionCode position_code = LoftrPositionCode::kCorrected;
  /// Runs the convolutions, nearly all of the work, in bfloat16; everything else stays in float32.
  bool bfloat16_convolutions = false;

  void Check() const;  ///< @throws InvalidOption naming the field
};

/// Channel 4k: sin(x w_k), 4k + 1: cos(x w_k), 4k + 2: sin(y w_k), 4k + 3: cos(y w_k); x is the
/// column and y the row, both from 1.
/// @param channels a multiple of 4
/// @return [channels, rows, columns], float32
torch::Tensor PositionCode(LoftrPositionCode variant, int channels, int rows, int columns);

/// Confidence that two tokens show the same point: softmax over i times softmax over j of
/// <first_i, second_j> / (C temperature).
/// @param first [L, C]
/// @param second [S, C]
/// @return [L, S]
torch::Tensor DualSoftmax(const torch::Tensor& first, const torch::Tensor& second,
                          double temperature = 0.1);

/// Rows and columns of a map of cells.
struct CellGrid {
  std::int64_t rows = 0, columns = 0;
};

/// Pairs of cells, each an index row * columns + column, by ascending `first`.
struct CellPairs {
  torch::Tensor first;        ///< [M] int64
  torch::Tensor second;       ///< [M] int64
  torch::Tensor confidences;  ///< [M]
};

/// Pairs whose confidence is the largest of its row and of its column and above `min_confidence`,
/// leaving out those with a cell less than `border` cells from an edge of its image.
/// @param confidence [cells of the first image, cells of the second image]
CellPairs SelectMutualMaxima(const torch::Tensor& confidence, CellGrid first, CellGrid second,
                             const LoftrOptions& options);

/// What LoFTR computes for two images: the matches, and each stage before them.
/// Points are pixel indices (x, y) in the network's input, with pixel centres at integers.
struct LoftrOutput {
  LoftrFeatures first_features, second_features;
  LoftrTokens coarse_input;  ///< [1, cells, 256], coarse features plus position code
  LoftrTokens coarse;        ///< after the coarse transformer
  torch::Tensor confidence;  ///< [cells of the first image, cells of the second image]
  CellPairs pairs;           ///< M matched cells
  LoftrTokens fine_input;    ///< [M, 25, 128], the windows around them
  LoftrTokens fine;          ///< after the fine transformer
  torch::Tensor offsets;  ///< [M, 2], (x, y) in the second image relative to the cell's point, in
                          ///< windows' halves
  torch::Tensor deviations;  ///< [M], sum of the standard deviations of x and y, in windows' halves
  torch::Tensor first_points;        ///< [M, 2], the cells' points
  torch::Tensor second_cell_points;  ///< [M, 2], the cells' points
  torch::Tensor second_points;       ///< [M, 2], these moved by the offsets
};

/// LoFTR (Sun, Shen, Wang, Bao and Zhou, "LoFTR: Detector-Free Local Feature Matching with
/// Transformers", CVPR 2021) with the dual softmax. Coarse tokens at stride 8 are matched; each
/// match is refined in the second image as the expectation of the correlation of the centre token
/// of the first image's 5 x 5 window at stride 2 with the second's. Parameters are named as in the
/// published checkpoint `indoor_ds_new.ckpt` without the prefix `matcher.`.
class LoftrImpl : public torch::nn::Module {
 public:
  LoftrImpl();

  /// @param first, second [1, 1, H, W], grey in [0, 1], the sizes multiples of 8 and not
  /// necessarily equal
  /// @throws Error if a size is no multiple of 8; InvalidOption
  LoftrOutput forward(const torch::Tensor& first, const torch::Tensor& second,
                      const LoftrOptions& options = {});

 private:
  LoftrFeatures Features(const torch::Tensor& image, const LoftrOptions& options) const;

  /// Windows [M, 25, 128] around matched cells, combined with the coarse tokens of the cells.
  torch::Tensor FineInput(const LoftrFeatures& features, const torch::Tensor& coarse,
                          const torch::Tensor& cells);

  LoftrBackbone backbone_;
  LoftrTransformer coarse_transformer_, fine_transformer_;
  torch::nn::Linear down_projection_, merge_;
};
TORCH_MODULE(Loftr);

}  // namespace antipode
