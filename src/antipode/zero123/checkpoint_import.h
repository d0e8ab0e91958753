#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "antipode/util/progress.h"
#include "antipode/weights/safetensors.h"
#include "antipode/zero123/zero123.h"

namespace antipode {

/// Names and shapes of the parts of a Zero123 model in the registry: "unet.", "autoencoder.", "clip." and
/// "projection." before the names of the published checkpoint.
std::map<std::string, std::vector<std::int64_t>> Zero123Tensors(const Zero123Config& config = {});

enum class UnetWeights {
  kOrdinary,       ///< those that the paper's program uses
  kMovingAverage,  ///< "EMA"; only in the original checkpoints
};

struct Zero123ImportOptions {
  Dtype dtype = Dtype::kF16;
  UnetWeights unet_weights = UnetWeights::kOrdinary;
  Zero123Config config;  ///< what the checkpoint must fit
};

/// The tensors of an original checkpoint (`105000.ckpt`, `zero123-xl.ckpt`) or of a folder in diffusers' layout (with
/// `cc_projection/` or `clip_camera_projection/`), by their names in the registry, converted when they are read.
/// Optimizer states and everything else that is not needed is never read.
/// @throws BadFile that names another family of models by its tensors, or lists what is missing, wrongly shaped or
///   does not belong to the needed parts
LazyTensorFile OpenZero123Checkpoint(const std::filesystem::path& path, const Zero123ImportOptions& options = {});

/// Reports the share that has been read.
LazyTensorFile WithProgress(const LazyTensorFile& file, const ProgressCallback& progress);

/// The name of a tensor of the registry in diffusers' layout, with the folder's name before it. CLIP's packed
/// projections are spread over three: `part` is "q", "k" or "v".
std::string DiffusersName(const std::string& name, const Zero123Config& config, const std::string& part = {});

}  // namespace antipode
