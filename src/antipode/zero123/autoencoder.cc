#include "antipode/zero123/autoencoder.h"

#include <cmath>
#include <functional>
#include <string>


namespace antipode {
namespace {

constexpr double kEpsilon = 1e-6;

}  // namespace

AutoencoderResidualBlockImpl::AutoencoderResidualBlockImpl(std::int64_t inputs, std::int64_t outputs)
    : norm1_(register_module("norm1", GroupNormalization(inputs, kEpsilon))),
      norm2_(register_module("norm2", GroupNormalization(outputs, kEpsilon))),
      conv1_(register_module("conv1", Convolution(inputs, outputs))),
      conv2_(register_module("conv2", Convolution(outputs, outputs))) {
  if (inputs != outputs) shortcut_ = register_module("nin_shortcut", PointwiseConvolution(inputs, outputs));
}

torch::Tensor AutoencoderResidualBlockImpl::forward(const torch::Tensor& x) const {
  const auto h = conv1_->forward(at::silu(norm1_->forward(x)));
  return conv2_->forward(at::silu(norm2_->forward(h))) + (shortcut_.is_empty() ? x : shortcut_->forward(x));
}

PixelAttentionImpl::PixelAttentionImpl(std::int64_t width)
    : norm_(register_module("norm", GroupNormalization(width, kEpsilon))),
      q_(register_module("q", PointwiseConvolution(width, width))),
      k_(register_module("k", PointwiseConvolution(width, width))),
      v_(register_module("v", PointwiseConvolution(width, width))),
      proj_out_(register_module("proj_out", PointwiseConvolution(width, width))) {}

torch::Tensor PixelAttentionImpl::forward(const torch::Tensor& x) const {
  const auto normalized = norm_->forward(x);
  const auto tokens = [](const torch::Tensor& map) { return map.flatten(2).transpose(1, 2).contiguous(); };
  const auto mixed = MultiHeadAttention(tokens(q_->forward(normalized)), tokens(k_->forward(normalized)),
                                        tokens(v_->forward(normalized)), 1);
  return x + proj_out_->forward(mixed.transpose(1, 2).reshape(x.sizes()));
}

AutoencoderDownsamplingImpl::AutoencoderDownsamplingImpl(std::int64_t width)
    : conv_(register_module("conv", Convolution(width, width, ConvolutionOptions{.stride = 2, .padding = 0}))) {}

torch::Tensor AutoencoderDownsamplingImpl::forward(const torch::Tensor& x) const {
  return conv_->forward(at::constant_pad_nd(x, {0, 1, 0, 1}));
}

/// Encoder or decoder: named steps in the order of their use.
class AutoencoderHalfImpl : public torch::nn::Module {
 public:
  torch::Tensor forward(torch::Tensor x, const Observation& observation) const {
    for (const auto& [name, run] : steps_) {
      x = run(x);
      observation.Show(name, x);
    }
    return x;
  }

  static std::shared_ptr<AutoencoderHalfImpl> Encoder(const AutoencoderConfig& config) {
    auto half = std::make_shared<AutoencoderHalfImpl>();
    std::int64_t width = config.base_width;
    half->Add(*half, "", "conv_in", Convolution(config.image_channels, width));
    const auto down = half->register_module("down", std::make_shared<torch::nn::Module>());
    for (std::size_t level = 0; level < config.multipliers.size(); ++level) {
      const auto [folder, prefix] = half->NewLevel(down, "down", level);
      width = half->AddBlocks(folder, prefix, width, config.base_width * config.multipliers[level], config.residual_blocks);
      if (level + 1 < config.multipliers.size())
        half->Add(*folder, prefix, "downsample", AutoencoderDownsampling(width));
    }
    half->AddMiddle(width);
    half->AddEnd(width, 2 * config.latent_channels);
    return half;
  }

  static std::shared_ptr<AutoencoderHalfImpl> Decoder(const AutoencoderConfig& config) {
    auto half = std::make_shared<AutoencoderHalfImpl>();
    std::int64_t width = config.base_width * config.multipliers.back();
    half->Add(*half, "", "conv_in", Convolution(config.latent_channels, width));
    half->AddMiddle(width);
    const auto up = half->register_module("up", std::make_shared<torch::nn::Module>());
    for (std::size_t level = config.multipliers.size(); level-- > 0;) {
      const auto [folder, prefix] = half->NewLevel(up, "up", level);
      width = half->AddBlocks(folder, prefix, width, config.base_width * config.multipliers[level], config.residual_blocks + 1);
      if (level > 0) half->Add(*folder, prefix, "upsample", Upsampling(width));
    }
    half->AddEnd(width, config.image_channels);
    return half;
  }

 private:
  template <typename Parent, typename Layer>
  void Add(Parent& parent, const std::string& prefix, const std::string& name, Layer layer) {
    parent.register_module(name, layer);
    steps_.emplace_back(prefix + name, [layer](const torch::Tensor& x) { return layer->forward(x); });
  }

  struct Level {
    std::shared_ptr<torch::nn::Module> folder;
    std::string prefix;
  };
  Level NewLevel(const std::shared_ptr<torch::nn::Module>& parent, const std::string& name, std::size_t level) {
    const std::string number = std::to_string(level);
    return {parent->register_module(number, std::make_shared<torch::nn::Module>()), name + "." + number + "."};
  }

  std::int64_t AddBlocks(const std::shared_ptr<torch::nn::Module>& level, const std::string& prefix, std::int64_t inputs,
                         std::int64_t outputs, std::int64_t count) {
    const auto folder = level->register_module("block", std::make_shared<torch::nn::Module>());
    for (std::int64_t i = 0; i < count; ++i)
      Add(*folder, prefix + "block.", std::to_string(i), AutoencoderResidualBlock(i == 0 ? inputs : outputs, outputs));
    return outputs;
  }

  void AddMiddle(std::int64_t width) {
    const auto middle = register_module("mid", std::make_shared<torch::nn::Module>());
    Add(*middle, "mid.", "block_1", AutoencoderResidualBlock(width, width));
    Add(*middle, "mid.", "attn_1", PixelAttention(width));
    Add(*middle, "mid.", "block_2", AutoencoderResidualBlock(width, width));
  }

  void AddEnd(std::int64_t width, std::int64_t outputs) {
    const auto norm = register_module("norm_out", GroupNormalization(width, kEpsilon));
    steps_.emplace_back("norm_out", [norm](const torch::Tensor& x) { return at::silu(norm->forward(x)); });
    Add(*this, "", "conv_out", Convolution(width, outputs));
  }

  std::vector<std::pair<std::string, std::function<torch::Tensor(const torch::Tensor&)>>> steps_;
};

AutoencoderImpl::AutoencoderImpl(const AutoencoderConfig& config)
    : latent_channels_(config.latent_channels),
      encoder_(register_module("encoder", AutoencoderHalfImpl::Encoder(config))),
      decoder_(register_module("decoder", AutoencoderHalfImpl::Decoder(config))),
      quant_conv_(register_module("quant_conv", PointwiseConvolution(2 * config.latent_channels, 2 * config.latent_channels))),
      post_quant_conv_(register_module("post_quant_conv", PointwiseConvolution(config.latent_channels, config.latent_channels))) {}

torch::Tensor AutoencoderImpl::Moments(const torch::Tensor& image, const Observation& observation) const {
  return quant_conv_->forward(encoder_->forward(image, observation.Inside("encoder")));
}

torch::Tensor AutoencoderImpl::Encode(const torch::Tensor& image) const {
  return Moments(image).slice(1, 0, latent_channels_);
}

torch::Tensor AutoencoderImpl::Decode(const torch::Tensor& latent, const Observation& observation) const {
  const auto spread = post_quant_conv_->forward(latent);
  observation.Show("post_quant_conv", spread);
  return decoder_->forward(spread, observation.Inside("decoder"));
}

}  // namespace antipode
