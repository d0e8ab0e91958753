#include "antipode/zero123/clip_image_tower.h"

#include <string>


namespace antipode {
namespace {

torch::Tensor OfColours(std::initializer_list<double> values, const torch::Tensor& like) {
  return torch::tensor(std::vector<double>(values), torch::kDouble).to(like.options()).view({1, 3, 1, 1});
}

}  // namespace

torch::Tensor ClipInput(const torch::Tensor& image, std::int64_t size) {
  const bool fits = image.size(2) == size && image.size(3) == size;
  constexpr bool kAlignCorners = true;
  const auto resized = fits ? image : at::upsample_bicubic2d(image, {size, size}, kAlignCorners);
  return ((resized + 1) / 2 - OfColours({0.48145466, 0.4578275, 0.40821073}, image)) /
         OfColours({0.26862954, 0.26130258, 0.27577711}, image);
}

/// h + attention(norm(h)), then + mlp(norm(h)).
class ClipBlockImpl : public torch::nn::Module {
 public:
  ClipBlockImpl(std::int64_t width, std::int64_t heads)
      : heads_(heads), ln_1_(register_module("ln_1", LayerNormalization(width))),
        ln_2_(register_module("ln_2", LayerNormalization(width))), out_(width, width), widen_(width, 4 * width),
        narrow_(4 * width, width) {
    const auto attention = register_module("attn", std::make_shared<torch::nn::Module>());
    in_weight_ = attention->register_parameter("in_proj_weight", torch::empty({3 * width, width}));
    in_bias_ = attention->register_parameter("in_proj_bias", torch::empty({3 * width}));
    attention->register_module("out_proj", out_);
    const auto mlp = register_module("mlp", std::make_shared<torch::nn::Module>());
    mlp->register_module("c_fc", widen_);
    mlp->register_module("c_proj", narrow_);
  }

  torch::Tensor forward(torch::Tensor h) const {
    const auto packed = at::linear(ln_1_->forward(h), in_weight_, in_bias_).chunk(3, -1);
    const auto q = packed[0].contiguous(), k = packed[1].contiguous(), v = packed[2].contiguous();
    h = h + out_->forward(MultiHeadAttention(q, k, v, heads_));
    return h + narrow_->forward(QuickGelu(widen_->forward(ln_2_->forward(h))));
  }

 private:
  std::int64_t heads_;
  LayerNormalization ln_1_, ln_2_;
  Dense out_, widen_, narrow_;
  torch::Tensor in_weight_, in_bias_;
};

ClipImageTowerImpl::ClipImageTowerImpl(const ClipConfig& config) : config_(config) {
  const auto visual = register_module("visual", std::make_shared<torch::nn::Module>());
  const std::int64_t side = config.image_size / config.patch;
  class_embedding_ = visual->register_parameter("class_embedding", torch::empty({config.width}));
  positional_embedding_ = visual->register_parameter("positional_embedding", torch::empty({side * side + 1, config.width}));
  proj_ = visual->register_parameter("proj", torch::empty({config.width, config.output_width}));
  const ConvolutionOptions patches{.kernel = config.patch, .stride = config.patch, .padding = 0, .bias = Bias::kWithout};
  conv1_ = visual->register_module("conv1", Convolution(3, config.width, patches));
  ln_pre_ = visual->register_module("ln_pre", LayerNormalization(config.width));
  ln_post_ = visual->register_module("ln_post", LayerNormalization(config.width));
  const auto transformer = visual->register_module("transformer", std::make_shared<torch::nn::Module>());
  const auto folder = transformer->register_module("resblocks", std::make_shared<torch::nn::Module>());
  for (std::int64_t i = 0; i < config.layers; ++i) {
    blocks_.push_back(std::make_shared<ClipBlockImpl>(config.width, config.heads));
    folder->register_module(std::to_string(i), blocks_.back());
  }
}

torch::Tensor ClipImageTowerImpl::forward(const torch::Tensor& image, const Observation& observation) const {
  const auto input = ClipInput(image, config_.image_size);
  observation.Show("preprocessed", input);
  const auto patches = conv1_->forward(input);
  observation.Show("conv1", patches);
  const auto tokens = patches.flatten(2).transpose(1, 2);  // [B, patches, width]
  const auto first = class_embedding_.expand({image.size(0), 1, config_.width});
  auto h = ln_pre_->forward(at::cat({first, tokens}, 1) + positional_embedding_);
  observation.Show("ln_pre", h);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    h = blocks_[i]->forward(h);
    observation.Show("resblocks." + std::to_string(i), h);
  }
  const auto summary = ln_post_->forward(h.select(1, 0));
  observation.Show("ln_post", summary);
  return at::matmul(summary, proj_);
}

}  // namespace antipode
