#include "antipode/zero123/checkpoint_import.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <optional>
#include <regex>
#include <utility>

#include "antipode/util/error.h"
#include "antipode/util/quote.h"
#include "antipode/weights/check.h"
#include "antipode/weights/pickle_import.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr char kGetTheRightOne[] = "give Zero123's 105000.ckpt or zero123-xl.ckpt, or its folder in diffusers' layout";

/// Where the parts of the registry's model are in an original checkpoint.
constexpr auto kOriginalPrefixes = std::to_array<std::pair<const char*, const char*>>(
    {{"unet.", "model.diffusion_model."}, {"autoencoder.", "first_stage_model."}, {"clip.", "cond_stage_model.model."},
     {"projection.", ""}});

bool Has(const LazyTensorFile& file, const std::string& name) { return file.tensors.contains(name); }

bool HasPrefix(const LazyTensorFile& file, const std::string& prefix) {
  const auto found = file.tensors.lower_bound(prefix);
  return found != file.tensors.end() && found->first.starts_with(prefix);
}

std::int64_t InputChannels(const LazyTensorFile& file) {
  const auto found = file.tensors.find("model.diffusion_model.input_blocks.0.0.weight");
  return found == file.tensors.end() || found->second.shape.size() != 4 ? 0 : found->second.shape[1];
}

/// The family that a checkpoint's tensors betray, if it is a known other one.
std::optional<std::string> OtherFamily(const LazyTensorFile& file) {
  if (HasPrefix(file, "conditioner.embedders.")) return "Stable Diffusion XL";
  if (HasPrefix(file, "cond_stage_model.transformer.text_model.")) return "a text-to-image Stable Diffusion 1 model";
  if (HasPrefix(file, "cond_stage_model.model.transformer.resblocks.") && !Has(file, "cc_projection.weight"))
    return "a text-to-image Stable Diffusion 2 model";
  if (HasPrefix(file, "control_model.") || HasPrefix(file, "input_hint_block.")) return "a ControlNet";
  for (const auto& [name, tensor] : file.tensors)
    if (name.find("lora_") != std::string::npos) return "a LoRA, changes to another model";
  if (HasPrefix(file, "matcher.backbone.")) return "LoFTR";
  if (HasPrefix(file, "model.diffusion_model.") && !Has(file, "cc_projection.weight")) {
    return InputChannels(file) == 4 ? "a diffusion model without an image latent"
                                    : "a model of image variations without Zero123's pose projection";
  }
  if (HasPrefix(file, "down_blocks.")) return "a single network in diffusers' layout: give the whole folder";
  return std::nullopt;
}

void RefuseOtherFamilies(const LazyTensorFile& file, const std::string& subject) {
  if (const auto family = OtherFamily(file)) throw BadFile(subject, "is " + *family + ", not Zero123", kGetTheRightOne);
  if (!HasPrefix(file, "model.diffusion_model.")) throw BadFile(subject, "holds no diffusion model", kGetTheRightOne);
}

std::string OriginalName(const std::string& name, UnetWeights unet_weights) {
  for (const auto& [part, prefix] : kOriginalPrefixes) {
    if (!name.starts_with(part)) continue;
    std::string original = prefix + name.substr(std::strlen(part));
    if (unet_weights == UnetWeights::kOrdinary || !name.starts_with("unet.")) return original;
    // The moving average is called like the weight, without "model." and all dots.
    original = original.substr(std::strlen("model."));
    std::erase(original, '.');
    return "model_ema." + original;
  }
  throw Error("tensor " + Quoted(name), "belongs to no part of Zero123");
}

/// Without the dictionary `state_dict` around everything.
LazyTensorFile WithoutStateDict(LazyTensorFile file) {
  constexpr std::string_view kPrefix = "state_dict.";
  LazyTensorFile inner{{}, std::move(file.metadata)};
  bool is_wrapped = false;
  for (const auto& [name, tensor] : file.tensors) is_wrapped |= name.starts_with(kPrefix);
  if (!is_wrapped) return file;
  for (auto& [name, tensor] : file.tensors)
    if (name.starts_with(kPrefix)) inner.tensors[name.substr(kPrefix.size())] = std::move(tensor);
  return inner;
}

/// Collects the wanted tensors, and everything that is wrong with them.
class Selection {
 public:
  Selection(std::string subject, Dtype dtype) : subject_(std::move(subject)), dtype_(dtype) {}

  void Add(const std::string& name, const std::vector<std::int64_t>& shape, const LazyTensor& tensor) {
    if (tensor.shape != shape) {
      problems_.push_back(Quoted(name) + " has the shape " + ShapeText(tensor.shape) + " instead of " + ShapeText(shape));
      return;
    }
    chosen_.tensors[name] = {dtype_, shape, [read = tensor.read, dtype = dtype_, name, subject = subject_] {
                               HostTensor values = read();
                               CheckFinite(values, name, subject);
                               return values.dtype == dtype ? values : ConvertTo(values, dtype);
                             }};
  }
  void Miss(const std::string& name) { problems_.push_back(Quoted(name) + " is missing"); }
  void Surplus(const std::string& name) { problems_.push_back(Quoted(name) + " does not belong to it"); }

  LazyTensorFile Take() {
    if (problems_.empty()) return std::move(chosen_);
    constexpr std::size_t kListed = 5;
    std::string text = "does not fit Zero123: ";
    for (std::size_t i = 0; i < std::min(problems_.size(), kListed); ++i) text += (i > 0 ? ", " : "") + problems_[i];
    if (problems_.size() > kListed) text += " and " + std::to_string(problems_.size() - kListed) + " more";
    throw BadFile(subject_, text, kGetTheRightOne);
  }

 private:
  std::string subject_;
  Dtype dtype_;
  LazyTensorFile chosen_;
  std::vector<std::string> problems_;
};

LazyTensorFile OpenOriginal(const fs::path& path, const Zero123ImportOptions& options) {
  const LazyTensorFile file = WithoutStateDict(OpenPytorchCheckpoint(path));
  RefuseOtherFamilies(file, path.string());
  if (options.unet_weights == UnetWeights::kMovingAverage && !HasPrefix(file, "model_ema."))
    throw BadFile(path.string(), "holds no moving average of the weights", "import the ordinary weights");
  Selection selection(path.string(), options.dtype);
  std::map<std::string, bool> used;
  for (const auto& [name, shape] : Zero123Tensors(options.config)) {
    const std::string original = OriginalName(name, options.unet_weights);
    const auto found = file.tensors.find(original);
    if (found == file.tensors.end()) {
      selection.Miss(original);
    } else {
      selection.Add(name, shape, found->second);
      used[original] = true;
    }
  }
  for (const char* const prefix : {"model.diffusion_model.", "first_stage_model.", "cond_stage_model.model.visual."}) {
    const bool is_replaced = options.unet_weights == UnetWeights::kMovingAverage && prefix == std::string("model.diffusion_model.");
    for (auto item = file.tensors.lower_bound(prefix); !is_replaced && item != file.tensors.end() && item->first.starts_with(prefix); ++item)
      if (!used.contains(item->first)) selection.Surplus(item->first);
  }
  return selection.Take();
}

/// The network file of a folder in diffusers' layout, whatever its format and precision.
LazyTensorFile OpenNetwork(const fs::path& folder) {
  for (const char* const stem : {"diffusion_pytorch_model", "model", "pytorch_model"}) {
    for (const char* const variant : {"", ".fp16"}) {
      const fs::path safe = folder / (std::string(stem) + variant + ".safetensors");
      if (fs::exists(safe)) return OpenSafetensors(safe);
      const fs::path pickled = folder / (std::string(stem) + variant + ".bin");
      if (fs::exists(pickled)) return OpenPytorchCheckpoint(pickled);
    }
  }
  throw BadFile(folder.string(), "holds no network, neither .safetensors nor .bin", kGetTheRightOne);
}

std::string Replaced(std::string text, const std::vector<std::pair<const char*, const char*>>& rules) {
  for (const auto& [pattern, replacement] : rules) text = std::regex_replace(text, std::regex(pattern), replacement);
  return text;
}

std::string ResidualName(const std::string& text) {
  return Replaced(text, {{"in_layers\\.0\\.", "norm1."}, {"in_layers\\.2\\.", "conv1."}, {"emb_layers\\.1\\.", "time_emb_proj."},
                         {"out_layers\\.0\\.", "norm2."}, {"out_layers\\.3\\.", "conv2."}, {"skip_connection\\.", "conv_shortcut."}});
}

std::string UnetName(const std::string& name, const UnetConfig& config) {
  std::smatch match;
  const std::int64_t down = config.residual_blocks + 1;
  if (std::regex_match(name, match, std::regex("input_blocks\\.(\\d+)\\.(\\d)\\.(.*)"))) {
    const std::int64_t index = std::stoll(match[1]) - 1;
    if (index < 0) return "conv_in." + match[3].str();
    const std::string block = "down_blocks." + std::to_string(index / down);
    if (index % down == config.residual_blocks) return block + ".downsamplers.0.conv." + match[3].str().substr(3);
    const std::string kind = match[2] == "0" ? ".resnets." : ".attentions.";
    return block + kind + std::to_string(index % down) + "." + ResidualName(match[3]);
  }
  if (std::regex_match(name, match, std::regex("middle_block\\.(\\d)\\.(.*)"))) {
    if (match[1] == "1") return "mid_block.attentions.0." + match[2].str();
    return "mid_block.resnets." + std::string(match[1] == "0" ? "0." : "1.") + ResidualName(match[2]);
  }
  if (std::regex_match(name, match, std::regex("output_blocks\\.(\\d+)\\.(\\d)\\.(.*)"))) {
    const std::int64_t index = std::stoll(match[1]);
    const std::string block = "up_blocks." + std::to_string(index / down);
    const std::string number = std::to_string(index % down) + ".";
    if (match[2] == "0") return block + ".resnets." + number + ResidualName(match[3]);
    if (match[3].str().starts_with("conv.")) return block + ".upsamplers.0." + match[3].str();
    return block + ".attentions." + number + match[3].str();
  }
  return Replaced(name, {{"^time_embed\\.0\\.", "time_embedding.linear_1."}, {"^time_embed\\.2\\.", "time_embedding.linear_2."},
                         {"^out\\.0\\.", "conv_norm_out."}, {"^out\\.2\\.", "conv_out."}});
}

std::string AutoencoderName(const std::string& name, const AutoencoderConfig& config) {
  std::smatch match;
  std::string text = name;
  // Levels of the decoder are counted from the other end.
  if (std::regex_search(text, match, std::regex("^decoder\\.up\\.(\\d+)\\."))) {
    const auto level = static_cast<std::int64_t>(config.multipliers.size()) - 1 - std::stoll(match[1]);
    text = "decoder.up_blocks." + std::to_string(level) + "." + match.suffix().str();
  }
  return Replaced(text, {{"^encoder\\.down\\.", "encoder.down_blocks."}, {"\\.block\\.", ".resnets."},
                         {"\\.downsample\\.", ".downsamplers.0."}, {"\\.upsample\\.", ".upsamplers.0."},
                         {"\\.mid\\.block_1\\.", ".mid_block.resnets.0."}, {"\\.mid\\.block_2\\.", ".mid_block.resnets.1."},
                         {"\\.attn_1\\.norm\\.", ".attn_1.group_norm."}, {"\\.attn_1\\.([qkv])\\.", ".attn_1.to_$1."},
                         {"\\.attn_1\\.proj_out\\.", ".attn_1.to_out.0."}, {"\\.mid\\.attn_1\\.", ".mid_block.attentions.0."},
                         {"\\.nin_shortcut\\.", ".conv_shortcut."}, {"\\.norm_out\\.", ".conv_norm_out."}});
}

std::string ClipName(const std::string& name, const std::string& part) {
  const std::string packed = "self_attn." + part + "_proj.";
  return Replaced(name, {{"^visual\\.class_embedding$", "vision_model.embeddings.class_embedding"},
                         {"^visual\\.positional_embedding$", "vision_model.embeddings.position_embedding.weight"},
                         {"^visual\\.conv1\\.", "vision_model.embeddings.patch_embedding."},
                         {"^visual\\.ln_pre\\.", "vision_model.pre_layrnorm."},  // so spelled in the files
                         {"^visual\\.ln_post\\.", "vision_model.post_layernorm."},
                         {"^visual\\.proj$", "visual_projection.weight"},
                         {"^visual\\.transformer\\.resblocks\\.", "vision_model.encoder.layers."},
                         {"\\.ln_1\\.", ".layer_norm1."}, {"\\.ln_2\\.", ".layer_norm2."},
                         {"attn\\.in_proj_", packed.c_str()}, {"\\.attn\\.out_proj\\.", ".self_attn.out_proj."},
                         {"\\.mlp\\.c_fc\\.", ".mlp.fc1."}, {"\\.mlp\\.c_proj\\.", ".mlp.fc2."}});
}

bool IsPacked(const std::string& name) { return name.find("attn.in_proj_") != std::string::npos; }

/// Rows of several tensors, one below the other.
LazyTensor Stacked(const std::vector<LazyTensor>& parts) {
  LazyTensor all = parts.front();
  all.shape[0] *= static_cast<std::int64_t>(parts.size());
  all.read = [parts, shape = all.shape] {
    HostTensor result{parts.front().dtype, shape, {}};
    for (const LazyTensor& part : parts) {
      const HostTensor rows = part.read();
      result.data.insert(result.data.end(), rows.data.begin(), rows.data.end());
    }
    return result;
  };
  return all;
}

LazyTensor Transposed(const LazyTensor& tensor) {
  LazyTensor turned = tensor;
  std::swap(turned.shape.at(0), turned.shape.at(1));
  turned.read = [read = tensor.read, shape = turned.shape] {
    const HostTensor source = read();
    const std::size_t size = SizeOf(source.dtype);
    const auto rows = static_cast<std::size_t>(shape[0]), columns = static_cast<std::size_t>(shape[1]);
    HostTensor result{source.dtype, shape, std::vector<std::byte>(source.data.size())};
    for (std::size_t r = 0; r < rows; ++r)
      for (std::size_t c = 0; c < columns; ++c)
        std::memcpy(&result.data[(r * columns + c) * size], &source.data[(c * rows + r) * size], size);
    return result;
  };
  return turned;
}

/// A 1 x 1 convolution that is stored as a matrix.
LazyTensor AsConvolution(const LazyTensor& tensor) {
  LazyTensor convolution = tensor;
  convolution.shape.insert(convolution.shape.end(), {1, 1});
  convolution.read = [read = tensor.read, shape = convolution.shape] {
    HostTensor values = read();
    values.shape = shape;
    return values;
  };
  return convolution;
}

/// A folder in diffusers' layout.
class DiffusersFolder {
 public:
  explicit DiffusersFolder(const fs::path& path) : path_(path) {
    if (!fs::is_directory(path / "unet"))
      throw BadFile(path.string(), "is no folder in diffusers' layout: it has no folder unet", kGetTheRightOne);
    if (!fs::is_directory(path / "cc_projection") && !fs::is_directory(path / "clip_camera_projection"))
      throw BadFile(path.string(), "is another model than Zero123: it has no pose projection", kGetTheRightOne);
    for (const char* const name : {"unet", "vae", "image_encoder", "cc_projection", "clip_camera_projection"})
      if (fs::is_directory(path / name)) networks_[name] = OpenNetwork(path / name);
  }

  /// Nothing if it is not there. `name` is "FOLDER/TENSOR".
  std::optional<LazyTensor> Find(const std::string& name) {
    const std::size_t slash = name.find('/');
    std::string folder = name.substr(0, slash), tensor = name.substr(slash + 1);
    if (folder == "cc_projection" && !networks_.contains(folder)) {
      folder = "clip_camera_projection";
      tensor = std::regex_replace(tensor, std::regex("^projection"), "proj");
    }
    for (const std::string& candidate : {tensor, OldAttentionName(tensor)}) {
      const auto found = networks_[folder].tensors.find(candidate);
      if (found == networks_[folder].tensors.end()) continue;
      used_[folder + "/" + candidate] = true;
      return found->second;
    }
    return std::nullopt;
  }

  std::vector<std::string> Unused() const {
    std::vector<std::string> names;
    for (const auto& [folder, network] : networks_)
      for (const auto& [name, tensor] : network.tensors)
        if (!used_.contains(folder + "/" + name) && !name.ends_with("position_ids")) names.push_back(folder + "/" + name);
    return names;
  }

 private:
  static std::string OldAttentionName(const std::string& name) {
    return Replaced(name, {{"attentions\\.0\\.to_q\\.", "attentions.0.query."}, {"attentions\\.0\\.to_k\\.", "attentions.0.key."},
                           {"attentions\\.0\\.to_v\\.", "attentions.0.value."}, {"attentions\\.0\\.to_out\\.0\\.", "attentions.0.proj_attn."}});
  }

  fs::path path_;
  std::map<std::string, LazyTensorFile> networks_;
  std::map<std::string, bool> used_;
};

std::optional<LazyTensor> FindInFolder(DiffusersFolder& folder, const std::string& name,
                                       const std::vector<std::int64_t>& shape, const Zero123Config& config) {
  if (IsPacked(name)) {
    std::vector<LazyTensor> parts;
    for (const char* const part : {"q", "k", "v"}) {
      const auto found = folder.Find(DiffusersName(name, config, part));
      if (!found) return std::nullopt;
      parts.push_back(*found);
    }
    return Stacked(parts);
  }
  auto tensor = folder.Find(DiffusersName(name, config));
  if (!tensor) return std::nullopt;
  if (name == "clip.visual.proj" && tensor->shape.size() == 2) return Transposed(*tensor);
  const bool is_matrix = shape.size() == 4 && tensor->shape.size() == 2;
  return is_matrix ? AsConvolution(*tensor) : *tensor;
}

LazyTensorFile OpenDiffusers(const fs::path& path, const Zero123ImportOptions& options) {
  if (options.unet_weights == UnetWeights::kMovingAverage)
    throw BadFile(path.string(), "holds no moving average of the weights", "import the ordinary weights");
  DiffusersFolder folder(path);
  Selection selection(path.string(), options.dtype);
  for (const auto& [name, shape] : Zero123Tensors(options.config)) {
    const auto tensor = FindInFolder(folder, name, shape, options.config);
    if (tensor) {
      selection.Add(name, shape, *tensor);
    } else {
      selection.Miss(DiffusersName(name, options.config, IsPacked(name) ? "q" : ""));
    }
  }
  for (const std::string& name : folder.Unused()) selection.Surplus(name);
  return selection.Take();
}

}  // namespace

std::map<std::string, std::vector<std::int64_t>> Zero123Tensors(const Zero123Config& config) {
  const Zero123 model(config);
  std::map<std::string, std::vector<std::int64_t>> tensors;
  const auto add = [&](const std::string& part, const torch::nn::Module& module) {
    for (const auto& item : module.named_parameters()) tensors[part + item.key()] = item.value().sizes().vec();
  };
  add("unet.", *model.unet);
  add("autoencoder.", *model.autoencoder);
  add("clip.", *model.clip);
  add("projection.", *model.projection);
  return tensors;
}

std::string DiffusersName(const std::string& name, const Zero123Config& config, const std::string& part) {
  const std::string inner = name.substr(name.find('.') + 1);
  if (name.starts_with("unet.")) return "unet/" + UnetName(inner, config.unet);
  if (name.starts_with("autoencoder.")) return "vae/" + AutoencoderName(inner, config.autoencoder);
  if (name.starts_with("clip.")) return "image_encoder/" + ClipName(inner, part);
  return "cc_projection/" + std::regex_replace(inner, std::regex("^cc_projection"), "projection");
}

LazyTensorFile OpenZero123Checkpoint(const fs::path& path, const Zero123ImportOptions& options) {
  LazyTensorFile file = fs::is_directory(path) ? OpenDiffusers(path, options) : OpenOriginal(path, options);
  file.metadata = options.config.ToMetadata();
  return file;
}

LazyTensorFile WithProgress(const LazyTensorFile& file, const ProgressCallback& progress) {
  LazyTensorFile reporting = file;
  const auto status = std::make_shared<Progress>(Progress{"importing", 0, static_cast<std::int64_t>(file.tensors.size()), {}});
  for (auto& [name, tensor] : reporting.tensors) {
    tensor.read = [read = tensor.read, status, progress] {
      if (progress) progress(*status);
      ++status->done;
      return read();
    };
  }
  return reporting;
}

}  // namespace antipode
