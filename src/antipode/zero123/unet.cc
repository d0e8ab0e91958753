#include "antipode/zero123/unet.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kResidualEpsilon = 1e-5;
constexpr double kTransformerEpsilon = 1e-6;

template <typename Holder>
Holder PutIn(const std::shared_ptr<torch::nn::Module>& folder, const std::string& name, Holder module) {
  return folder->register_module(name, std::move(module));
}

torch::Tensor Silu(const torch::Tensor& x) { return at::silu(x); }

}  // namespace

void UnetConfig::Check() const {
  const auto require = [](bool valid, const char* field, const char* remedy) {
    if (!valid) throw InvalidOption(field, "has an impossible value", remedy);
  };
  require(input_channels > 0 && output_channels > 0, "channels", "use positive numbers");
  require(base_width > 0 && base_width % 32 == 0, "base_width", "use a multiple of 32, the number of norm groups");
  require(!multipliers.empty() && std::ranges::all_of(multipliers, [](auto m) { return m > 0; }), "multipliers",
          "give one positive number a level");
  require(residual_blocks > 0, "residual_blocks", "use a positive number");
  require(heads > 0 && base_width % heads == 0, "heads", "use a divisor of base_width");
  require(transformer_depth > 0 && context_width > 0, "transformer", "use positive sizes");
}

torch::Tensor TimestepEmbedding(const torch::Tensor& timesteps, std::int64_t width) {
  const std::int64_t half = width / 2;
  const auto frequencies =
      at::exp(at::arange(half, torch::dtype(torch::kFloat).device(timesteps.device())) * (-std::log(10000.0) / half));
  const auto angles = timesteps.to(torch::kFloat).unsqueeze(1) * frequencies.unsqueeze(0);
  return at::cat({at::cos(angles), at::sin(angles)}, 1);
}

UnetResidualBlockImpl::UnetResidualBlockImpl(std::int64_t inputs, std::int64_t outputs, std::int64_t embedding_width)
    : first_norm_(inputs, kResidualEpsilon),
      second_norm_(outputs, kResidualEpsilon),
      first_(inputs, outputs),
      second_(outputs, outputs),
      embedding_(embedding_width, outputs) {
  const auto in_layers = register_module("in_layers", std::make_shared<torch::nn::Module>());
  PutIn(in_layers, "0", first_norm_);
  PutIn(in_layers, "2", first_);
  PutIn(register_module("emb_layers", std::make_shared<torch::nn::Module>()), "1", embedding_);
  const auto out_layers = register_module("out_layers", std::make_shared<torch::nn::Module>());
  PutIn(out_layers, "0", second_norm_);
  PutIn(out_layers, "3", second_);
  if (inputs != outputs) shortcut_ = register_module("skip_connection", PointwiseConvolution(inputs, outputs));
}

torch::Tensor UnetResidualBlockImpl::forward(const torch::Tensor& x, const torch::Tensor& embedding,
                                             const Observation& observation) const {
  auto h = first_->forward(Silu(first_norm_->forward(x)));
  observation.Show("in_layers", h);
  const auto shift = embedding_->forward(Silu(embedding));
  observation.Show("emb_layers", shift);
  h = second_->forward(Silu(second_norm_->forward(h + shift.unsqueeze(2).unsqueeze(3))));
  observation.Show("out_layers", h);
  return h + (shortcut_.is_empty() ? x : shortcut_->forward(x));
}

CrossAttentionImpl::CrossAttentionImpl(std::int64_t width, std::int64_t context_width, std::int64_t heads)
    : to_q_(register_module("to_q", Dense(width, width, Bias::kWithout))),
      to_k_(register_module("to_k", Dense(context_width, width, Bias::kWithout))),
      to_v_(register_module("to_v", Dense(context_width, width, Bias::kWithout))),
      to_out_(width, width),
      heads_(heads) {
  PutIn(register_module("to_out", std::make_shared<torch::nn::Module>()), "0", to_out_);
}

torch::Tensor CrossAttentionImpl::forward(const torch::Tensor& x, const torch::Tensor& context) const {
  return to_out_->forward(
      MultiHeadAttention(to_q_->forward(x), to_k_->forward(context), to_v_->forward(context), heads_));
}

torch::Tensor CrossAttentionImpl::OfSingleToken(const torch::Tensor& token) const {
  return to_out_->forward(to_v_->forward(token));
}

GatedGeluImpl::GatedGeluImpl(std::int64_t width, std::int64_t outputs)
    : proj_(register_module("proj", Dense(width, 2 * outputs))) {}

torch::Tensor GatedGeluImpl::forward(const torch::Tensor& x) const {
  const auto parts = proj_->forward(x).chunk(2, -1);
  return parts[0] * at::gelu(parts[1]);
}

UnetDownsamplingImpl::UnetDownsamplingImpl(std::int64_t width)
    : op_(register_module("op", Convolution(width, width, ConvolutionOptions{.stride = 2}))) {}

torch::Tensor UnetDownsamplingImpl::forward(const torch::Tensor& x) const { return op_->forward(x); }

/// x + attention(norm(x)), then + attention to the context, then + feed-forward.
class UnetTransformerImpl : public torch::nn::Module {
 public:
  UnetTransformerImpl(std::int64_t width, const UnetConfig& config)
      : attn1_(register_module("attn1", CrossAttention(width, width, config.heads))),
        attn2_(register_module("attn2", CrossAttention(width, config.context_width, config.heads))),
        norm1_(register_module("norm1", LayerNormalization(width))),
        norm2_(register_module("norm2", LayerNormalization(width))),
        norm3_(register_module("norm3", LayerNormalization(width))),
        gate_(width, 4 * width),
        feed_forward_(4 * width, width) {
    const auto net = std::make_shared<torch::nn::Module>();
    register_module("ff", std::make_shared<torch::nn::Module>())->register_module("net", net);
    PutIn(net, "0", gate_);
    PutIn(net, "2", feed_forward_);
  }

  torch::Tensor OfSingleToken(const torch::Tensor& token) const { return attn2_->OfSingleToken(token); }

  /// @param constant what attending to the context gives, if that is the same at every pixel; else undefined
  torch::Tensor forward(torch::Tensor x, const torch::Tensor& tokens, const torch::Tensor& constant,
                        const Observation& observation) const {
    const auto normalized = norm1_->forward(x);
    const auto own = attn1_->forward(normalized, normalized);
    observation.Show("attn1", own);
    x = x + own;
    const auto of_context = constant.defined() ? constant : attn2_->forward(norm2_->forward(x), tokens);
    observation.Show("attn2", of_context.expand_as(x));
    x = x + of_context;
    const auto gated = gate_->forward(norm3_->forward(x));
    observation.Show("ff.net.0", gated);
    const auto mixed = feed_forward_->forward(gated);
    observation.Show("ff", mixed);
    return x + mixed;
  }

 private:
  CrossAttention attn1_, attn2_;
  LayerNormalization norm1_, norm2_, norm3_;
  GatedGelu gate_;
  Dense feed_forward_;
};

namespace {

/// Transformer blocks on the pixels of a feature map.
class SpatialTransformer : public torch::nn::Module {
 public:
  /// @param first the number of transformer blocks before this one in the network
  SpatialTransformer(std::int64_t width, const UnetConfig& config, std::size_t first)
      : first_(first),
        norm_(register_module("norm", GroupNormalization(width, kTransformerEpsilon))),
        proj_in_(register_module("proj_in", PointwiseConvolution(width, width))),
        proj_out_(register_module("proj_out", PointwiseConvolution(width, width))) {
    const auto folder = register_module("transformer_blocks", std::make_shared<torch::nn::Module>());
    for (std::int64_t i = 0; i < config.transformer_depth; ++i) {
      blocks.push_back(std::make_shared<UnetTransformerImpl>(width, config));
      folder->register_module(std::to_string(i), blocks.back());
    }
  }

  torch::Tensor forward(const torch::Tensor& x, const UnetContext& context, const Observation& observation) const {
    const auto normalized = norm_->forward(x);
    observation.Show("norm", normalized);
    const auto projected = proj_in_->forward(normalized);
    observation.Show("proj_in", projected);
    auto u = projected.flatten(2).transpose(1, 2).contiguous();  // [B, H W, C]
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const std::string name = "transformer_blocks." + std::to_string(i);
      const auto constant = context.constant.empty() ? torch::Tensor() : context.constant.at(first_ + i);
      u = blocks[i]->forward(u, context.tokens, constant, observation.Inside(name));
      observation.Show(name, u);
    }
    const auto out = proj_out_->forward(u.transpose(1, 2).reshape(x.sizes()));
    observation.Show("proj_out", out);
    return out + x;
  }

  std::vector<std::shared_ptr<UnetTransformerImpl>> blocks;

 private:
  std::size_t first_;
  GroupNormalization norm_;
  Convolution proj_in_, proj_out_;
};

struct LayerInput {
  const torch::Tensor& embedding;
  const UnetContext& context;
};

}  // namespace

/// The layers of one entry of `input_blocks`, `middle_block` or `output_blocks`, applied in turn.
class UnetBlockImpl : public torch::nn::Module {
 public:
  using Layer = std::function<torch::Tensor(const torch::Tensor&, const LayerInput&, const Observation&)>;

  void AddConvolution(std::int64_t inputs, std::int64_t outputs) { AddPlain(Convolution(inputs, outputs)); }

  void AddResidual(std::int64_t inputs, std::int64_t outputs, std::int64_t embedding_width) {
    Add(UnetResidualBlock(inputs, outputs, embedding_width),
        [](const auto& block, const torch::Tensor& x, const LayerInput& input, const Observation& observation) {
          return block->forward(x, input.embedding, observation);
        });
  }

  void AddTransformer(std::int64_t width, const UnetConfig& config,
                      std::vector<std::shared_ptr<UnetTransformerImpl>>& all) {
    const auto transformer = std::make_shared<SpatialTransformer>(width, config, all.size());
    all.insert(all.end(), transformer->blocks.begin(), transformer->blocks.end());
    Add(transformer, [](const auto& layer, const torch::Tensor& x, const LayerInput& input,
                        const Observation& observation) { return layer->forward(x, input.context, observation); });
  }

  void AddDownsampling(std::int64_t width) { AddPlain(UnetDownsampling(width)); }
  void AddUpsampling(std::int64_t width) { AddPlain(Upsampling(width)); }

  torch::Tensor forward(torch::Tensor x, const LayerInput& input, const Observation& observation) const {
    for (std::size_t i = 0; i < layers_.size(); ++i) {
      const std::string name = std::to_string(i);
      x = layers_[i](x, input, observation.Inside(name));
      observation.Show(name, x);
    }
    return x;
  }

 private:
  template <typename Module, typename Function>
  void Add(Module module, Function function) {
    register_module(std::to_string(layers_.size()), module);
    layers_.push_back([module, function](const torch::Tensor& x, const LayerInput& input, const Observation& observation) {
      return function(module, x, input, observation);
    });
  }

  template <typename Module>
  void AddPlain(Module module) {
    Add(module, [](const auto& layer, const torch::Tensor& x, const LayerInput&, const Observation&) { return layer->forward(x); });
  }

  std::vector<Layer> layers_;
};

UnetImpl::UnetImpl(const UnetConfig& config) : config_(config) {
  config.Check();
  const std::int64_t embedding_width = 4 * config.base_width;
  const auto time_embed = register_module("time_embed", std::make_shared<torch::nn::Module>());
  first_embedding_ = PutIn(time_embed, "0", Dense(config.base_width, embedding_width));
  second_embedding_ = PutIn(time_embed, "2", Dense(embedding_width, embedding_width));

  const auto inputs = register_module("input_blocks", std::make_shared<torch::nn::Module>());
  const auto outputs = std::make_shared<torch::nn::Module>();
  const auto new_block = [](const std::shared_ptr<torch::nn::Module>& folder, auto& list) {
    list.push_back(std::make_shared<UnetBlockImpl>());
    folder->register_module(std::to_string(list.size() - 1), list.back());
    return list.back();
  };
  const auto has_attention = [&](std::size_t level) {
    return std::ranges::find(config.attention_factors, std::int64_t{1} << level) != config.attention_factors.end();
  };

  const std::size_t levels = config.multipliers.size();
  std::vector<std::int64_t> skipped{config.base_width};  // widths of what the output blocks will pop
  std::int64_t width = config.base_width;
  new_block(inputs, input_blocks_)->AddConvolution(config.input_channels, width);
  for (std::size_t level = 0; level < levels; ++level) {
    const std::int64_t wanted = config.base_width * config.multipliers[level];
    for (std::int64_t i = 0; i < config.residual_blocks; ++i) {
      const auto block = new_block(inputs, input_blocks_);
      block->AddResidual(width, wanted, embedding_width);
      if (has_attention(level)) block->AddTransformer(wanted, config, transformers_);
      skipped.push_back(width = wanted);
    }
    if (level + 1 == levels) break;
    new_block(inputs, input_blocks_)->AddDownsampling(width);
    skipped.push_back(width);
  }

  middle_block_ = register_module("middle_block", std::make_shared<UnetBlockImpl>());
  middle_block_->AddResidual(width, width, embedding_width);
  middle_block_->AddTransformer(width, config, transformers_);
  middle_block_->AddResidual(width, width, embedding_width);

  register_module("output_blocks", outputs);
  for (std::size_t level = levels; level-- > 0;) {
    const std::int64_t wanted = config.base_width * config.multipliers[level];
    for (std::int64_t i = 0; i <= config.residual_blocks; ++i) {
      const auto block = new_block(outputs, output_blocks_);
      block->AddResidual(width + skipped.back(), wanted, embedding_width);
      skipped.pop_back();
      width = wanted;
      if (has_attention(level)) block->AddTransformer(width, config, transformers_);
      if (level > 0 && i == config.residual_blocks) block->AddUpsampling(width);
    }
  }

  const auto out = register_module("out", std::make_shared<torch::nn::Module>());
  out_norm_ = PutIn(out, "0", GroupNormalization(width, kResidualEpsilon));
  out_ = PutIn(out, "2", Convolution(width, config.output_channels));
}

torch::Dtype UnetImpl::Type() const { return out_->weight.scalar_type(); }

UnetContext UnetImpl::Prepare(const torch::Tensor& tokens, ContextPath path) const {
  UnetContext context{tokens.to(Type()), {}};
  if (tokens.size(1) != 1 || path == ContextPath::kGeneral) return context;
  for (const auto& transformer : transformers_) context.constant.push_back(transformer->OfSingleToken(context.tokens));
  return context;
}

torch::Tensor UnetImpl::Embed(const torch::Tensor& timesteps, const Observation& observation) const {
  const auto sinusoids = TimestepEmbedding(timesteps, config_.base_width);
  observation.Show("temb", sinusoids);
  const auto typed = sinusoids.to(first_embedding_->weight.scalar_type());
  const auto embedding = second_embedding_->forward(Silu(first_embedding_->forward(typed)));
  observation.Show("emb", embedding);
  return embedding;
}

torch::Tensor UnetImpl::Predict(const torch::Tensor& h) const { return out_->forward(Silu(out_norm_->forward(h))); }

torch::Tensor UnetImpl::forward(const torch::Tensor& x, const torch::Tensor& timesteps, const UnetContext& context,
                                const Observation& observation) const {
  const auto embedding = Embed(timesteps, observation);
  const LayerInput input{embedding, context};
  const auto run = [&](const std::string& name, const UnetBlockImpl& block, const torch::Tensor& h) {
    const auto out = block.forward(h, input, observation.Inside(name));
    observation.Show(name, out);
    return out;
  };
  auto h = x.to(Type());
  std::vector<torch::Tensor> skipped;
  for (std::size_t i = 0; i < input_blocks_.size(); ++i)
    skipped.push_back(h = run("input_blocks." + std::to_string(i), *input_blocks_[i], h));
  h = run("middle_block", *middle_block_, h);
  for (std::size_t i = 0; i < output_blocks_.size(); ++i) {
    h = run("output_blocks." + std::to_string(i), *output_blocks_[i], at::cat({h, skipped.back()}, 1));
    skipped.pop_back();
  }
  return Predict(h).to(x.scalar_type());
}

torch::Tensor UnetImpl::ForwardAndKeep(const torch::Tensor& x, const torch::Tensor& timesteps,
                                       const UnetContext& context, UnetCache& cache) const {
  const std::string deepest_kept =
      "output_blocks." + std::to_string(static_cast<std::int64_t>(output_blocks_.size()) - cache.shallow_blocks - 1);
  return forward(x, timesteps, context, Observation([&](const std::string& name, const torch::Tensor& output) {
                   if (name == deepest_kept) cache.deep = output;
                 }));
}

torch::Tensor UnetImpl::ForwardShallow(const torch::Tensor& x, const torch::Tensor& timesteps,
                                       const UnetContext& context, const UnetCache& cache) const {
  if (!cache.deep.defined()) throw Error("UNet cache", "is empty", "run a full step first");
  const auto embedding = Embed(timesteps, {});
  const LayerInput input{embedding, context};
  auto h = x.to(Type());
  std::vector<torch::Tensor> skipped;
  for (std::int64_t i = 0; i < cache.shallow_blocks; ++i)
    skipped.push_back(h = input_blocks_[static_cast<std::size_t>(i)]->forward(h, input, {}));
  h = cache.deep;
  for (std::size_t i = output_blocks_.size() - static_cast<std::size_t>(cache.shallow_blocks); i < output_blocks_.size(); ++i) {
    h = output_blocks_[i]->forward(at::cat({h, skipped.back()}, 1), input, {});
    skipped.pop_back();
  }
  return Predict(h).to(x.scalar_type());
}

torch::Tensor PredictWithCache(const UnetImpl& unet, const torch::Tensor& x, const torch::Tensor& timesteps, const UnetContext& context,
                               UnetCache& cache, int step, int full_step_every) {
  if (full_step_every == 1) return unet.forward(x, timesteps, context);
  if (step % full_step_every == 0 || !cache.deep.defined()) return unet.ForwardAndKeep(x, timesteps, context, cache);
  return unet.ForwardShallow(x, timesteps, context, cache);
}

}  // namespace antipode
