#include "antipode/matching/light_glue.h"

#include <algorithm>
#include <cmath>

#include "antipode/nn/module_weights.h"
#include "antipode/nn/parts.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kLayerNormEpsilon = 1e-5;

torch::Tensor Project(const torch::nn::Linear& linear, const torch::Tensor& x) {
  return at::linear(x, linear->weight, linear->bias);
}

/// Keypoints relative to the image's centre, in halves of its longer side. Only differences between
/// them count.
torch::Tensor RelativePositions(const LocalFeatures& features) {
  const auto size =
      torch::tensor({features.image_size.width, features.image_size.height}, torch::kFloat)
          .to(features.keypoints.options());
  const double longer = std::max(features.image_size.width, features.image_size.height);
  return (features.keypoints - size / 2) / (longer / 2);
}

LightGlueMatches NoMatches(int layers, torch::Device device) {
  const auto none = torch::empty({0}, torch::dtype(torch::kLong).device(device));
  return {{none, none, none.to(torch::kFloat)}, layers};
}

}  // namespace

void LightGlueConfig::Check() const {
  if (input_size < 1 || layers < 1 || heads < 1)
    throw InvalidOption("LightGlueConfig", "has a size that is not positive",
                        "use the sizes of the checkpoint");
  if (descriptor_size < 1 || descriptor_size % (2 * heads) != 0)
    throw InvalidOption("descriptor_size", "is not a multiple of twice the number of heads",
                        "use the sizes of the checkpoint");
}

LightGlueConfig LightGlueConfig::ForAliked() { return {}; }

LightGlueConfig LightGlueConfig::LighterGlue() {
  return {.input_size = 64,
          .descriptor_size = 96,
          .layers = 6,
          .heads = 1,
          .depth_confidence = -1,
          .width_confidence = 0.95,
          .filter_threshold = 0.1};
}

/// The points of both images, those of the reference first.
struct LightGlueImpl::Tokens {
  torch::Tensor states;        // [M + N, D]
  torch::Tensor cosine, sine;  // [M + N, 1, D / (2 heads)], of the rotary encoding
  torch::Tensor features;      // [M + N], index of the feature in its image
  std::int64_t reference = 0;  // M

  std::int64_t query() const { return states.size(0) - reference; }
};

LightGlueImpl::LightGlueImpl(const LightGlueConfig& config) : config_(config) {
  config_.Check();
  const int size = config_.descriptor_size;
  if (config_.input_size != size) input_ = MakeLinear("input_proj", config_.input_size, size);
  position_ = MakeLinear("posenc.Wr", 2, size / config_.heads / 2, false);
  for (int i = 0; i < config_.layers; ++i) {
    const std::string name = "transformers." + std::to_string(i) + ".";
    Layer layer;
    layer.self_projection = MakeLinear(name + "self_attn.Wqkv", size, 3 * size);
    layer.self_output = MakeLinear(name + "self_attn.out_proj", size, size);
    layer.self_update = MakeFeedForward(name + "self_attn.ffn");
    layer.cross_key = MakeLinear(name + "cross_attn.to_qk", size, size);
    layer.cross_value = MakeLinear(name + "cross_attn.to_v", size, size);
    layer.cross_output = MakeLinear(name + "cross_attn.to_out", size, size);
    layer.cross_update = MakeFeedForward(name + "cross_attn.ffn");
    layers_.push_back(layer);
    const std::string assignment = "log_assignment." + std::to_string(i) + ".";
    assignments_.push_back({MakeLinear(assignment + "matchability", size, 1),
                            MakeLinear(assignment + "final_proj", size, size)});
    if (i + 1 < config_.layers)
      confidences_.push_back(
          MakeLinear("token_confidence." + std::to_string(i) + ".token.0", size, 1));
  }
}

torch::nn::Linear LightGlueImpl::MakeLinear(const std::string& name, int in_size, int out_size,
                                            bool with_bias) {
  torch::nn::Linear linear(torch::nn::LinearOptions(in_size, out_size).bias(with_bias));
  RegisterAt(*this, name, linear.ptr());
  return linear;
}

LightGlueImpl::FeedForward LightGlueImpl::MakeFeedForward(const std::string& name) {
  const int size = config_.descriptor_size;
  FeedForward layers;
  layers.expand = MakeLinear(name + ".0", 2 * size, 2 * size);
  layers.norm = torch::nn::LayerNorm(torch::nn::LayerNormOptions({2 * size}));
  RegisterAt(*this, name + ".1", layers.norm.ptr());
  layers.project = MakeLinear(name + ".3", 2 * size, size);
  return layers;
}

void LightGlueImpl::Prepare() {
  const torch::NoGradGuard no_gradient;
  prepared_ = PreparedLayers();
}

std::vector<LightGlueImpl::PreparedLayer> LightGlueImpl::PreparedLayers() const {
  std::vector<PreparedLayer> prepared;
  for (const Layer& layer : layers_) {
    prepared.push_back({PrepareSelfProjection(layer.self_projection),
                        {torch::cat({layer.cross_key->weight, layer.cross_value->weight}),
                         torch::cat({layer.cross_key->bias, layer.cross_value->bias})},
                        PrepareUpdate(layer.self_output, layer.self_update),
                        PrepareUpdate(layer.cross_output, layer.cross_update)});
  }
  return prepared;
}

/// The checkpoint interleaves query, key and value, and the two coordinates that the rotary
/// encoding turns together. Apart, they are contiguous blocks: [query, key][head][first, second
/// coordinate], [value][head].
LightGlueImpl::Affine LightGlueImpl::PrepareSelfProjection(
    const torch::nn::Linear& projection) const {
  const int size = config_.descriptor_size, pairs = size / config_.heads / 2;
  const auto reorder = [&](const torch::Tensor& rows) {
    const auto parts = rows.reshape({config_.heads, pairs, 2, 3, -1});
    const auto turned = parts.narrow(3, 0, 2).permute({3, 0, 2, 1, 4}).reshape({2 * size, -1});
    const auto values = parts.select(3, 2).reshape({size, -1});
    return torch::cat({turned, values});
  };
  return {reorder(projection->weight), reorder(projection->bias).squeeze(1)};
}

/// The output projection of the attention is linear, as is what follows it: one matrix does both.
LightGlueImpl::Update LightGlueImpl::PrepareUpdate(const torch::nn::Linear& output,
                                                   const FeedForward& layers) {
  const auto halves = layers.expand->weight.chunk(2, 1);
  const auto from_context = torch::mm(halves[1], output->weight);
  const auto bias = layers.expand->bias + torch::mv(halves[1], output->bias);
  return {halves[0].t().contiguous(), from_context.t().contiguous(), bias, layers};
}

LightGlueMatches LightGlueImpl::Match(const LocalFeatures& reference,
                                      const LocalFeatures& query) const {
  const torch::InferenceMode inference;
  if (prepared_.empty())
    throw Error("LightGlue", "is not prepared", "call Prepare() after loading the weights");
  if (reference.size() == 0 || query.size() == 0) return NoMatches(0, reference.keypoints.device());
  Tokens tokens = Embed(reference, query);
  const std::int64_t points = tokens.states.size(0);
  for (int i = 0; i < config_.layers; ++i) {
    AttendToSelf(prepared_[i], tokens);
    AttendToOther(prepared_[i], tokens);
    if (i + 1 == config_.layers) break;
    torch::Tensor confidence;
    if (config_.depth_confidence > 0) {
      confidence = Project(confidences_[i], tokens.states).squeeze(1).sigmoid_();
      const double unsure = (confidence < SureFrom(i)).sum().item<double>();
      if (1 - unsure / static_cast<double>(points) > config_.depth_confidence)
        return Assign(i, tokens);
    }
    if (config_.width_confidence > 0) DropUnmatchable(i, confidence, tokens);
    if (tokens.reference == 0 || tokens.query() == 0)
      return NoMatches(i + 1, tokens.states.device());
  }
  return Assign(config_.layers - 1, tokens);
}

LightGlueImpl::Tokens LightGlueImpl::Embed(const LocalFeatures& reference,
                                           const LocalFeatures& query) const {
  const auto descriptors = torch::cat({reference.descriptors, query.descriptors});
  if (descriptors.size(1) != config_.input_size)
    throw Error("LightGlue", "was given descriptors of another size",
                "use the features it was trained for");
  const auto positions = torch::cat({RelativePositions(reference), RelativePositions(query)});
  const auto angles = Project(position_, positions).unsqueeze(1);
  const auto indices = [](const LocalFeatures& features) {
    return torch::arange(features.size(), features.keypoints.options().dtype(torch::kLong));
  };
  return {input_ ? Project(input_, descriptors) : descriptors.clone(), angles.cos(), angles.sin(),
          torch::cat({indices(reference), indices(query)}), reference.size()};
}

/// [N, heads, size] each to [N, heads size].
torch::Tensor LightGlueImpl::Attend(const torch::Tensor& queries, const torch::Tensor& keys,
                                    const torch::Tensor& values) const {
  const auto batched = [](const torch::Tensor& x) { return x.transpose(0, 1).unsqueeze(0); };
  const auto context =
      at::scaled_dot_product_attention(batched(queries), batched(keys), batched(values));
  return context.squeeze(0).transpose(0, 1).flatten(1);
}

void LightGlueImpl::Apply(const Update& update, const torch::Tensor& context, Tokens& tokens) {
  auto hidden = at::addmm(update.bias, tokens.states, update.from_token);
  hidden = at::addmm(hidden, context, update.from_context);
  const FeedForward& layers = update.layers;
  hidden = at::layer_norm(hidden, {hidden.size(1)}, layers.norm->weight, layers.norm->bias,
                          kLayerNormEpsilon);
  tokens.states = tokens.states + Project(layers.project, at::gelu(hidden));
}

void LightGlueImpl::AttendToSelf(const PreparedLayer& layer, Tokens& tokens) const {
  const int heads = config_.heads, size = config_.descriptor_size;
  const auto all =
      at::linear(tokens.states, layer.self_projection.weight, layer.self_projection.bias);
  const auto halves = all.narrow(1, 0, 2 * size).view({-1, 2 * heads, 2, size / heads / 2});
  auto turned = halves * tokens.cosine.unsqueeze(1);
  turned.select(2, 0).addcmul_(halves.select(2, 1), tokens.sine, -1);
  turned.select(2, 1).addcmul_(halves.select(2, 0), tokens.sine);
  turned = turned.view({-1, 2, heads, size / heads});
  const auto values = all.narrow(1, 2 * size, size).view({-1, heads, size / heads});

  const auto attend = [&](std::int64_t begin, std::int64_t count) {
    const auto part = turned.narrow(0, begin, count);
    return Attend(part.select(1, 0), part.select(1, 1), values.narrow(0, begin, count));
  };
  const auto context =
      torch::cat({attend(0, tokens.reference), attend(tokens.reference, tokens.query())});
  Apply(layer.self_update, context, tokens);
}

void LightGlueImpl::AttendToOther(const PreparedLayer& layer, Tokens& tokens) const {
  const int heads = config_.heads, size = config_.descriptor_size;
  const auto all =
      at::linear(tokens.states, layer.cross_projection.weight, layer.cross_projection.bias)
          .view({-1, 2, heads, size / heads});
  const auto reference = all.narrow(0, 0, tokens.reference);
  const auto query = all.narrow(0, tokens.reference, tokens.query());
  const auto attend = [&](const torch::Tensor& to, const torch::Tensor& from) {
    return Attend(to.select(1, 0), from.select(1, 0), from.select(1, 1));
  };
  Apply(layer.cross_update, torch::cat({attend(reference, query), attend(query, reference)}),
        tokens);
}

float LightGlueImpl::SureFrom(int layer) const {
  return static_cast<float>(0.8 + 0.1 * std::exp(-4.0 * layer / config_.layers));
}

void LightGlueImpl::DropUnmatchable(int layer, const torch::Tensor& confidence,
                                    Tokens& tokens) const {
  const auto matchability =
      Project(assignments_[layer].matchability, tokens.states).squeeze(1).sigmoid_();
  auto keep = matchability > 1 - config_.width_confidence;
  if (confidence.defined()) keep.logical_or_(confidence <= SureFrom(layer));
  const auto kept = keep.nonzero().squeeze(1);
  if (kept.size(0) == keep.size(0)) return;
  const std::int64_t reference = keep.narrow(0, 0, tokens.reference).sum().item<std::int64_t>();
  tokens = {tokens.states.index_select(0, kept), tokens.cosine.index_select(0, kept),
            tokens.sine.index_select(0, kept), tokens.features.index_select(0, kept), reference};
}

std::vector<LightGlueAssignment> LightGlueImpl::Assignments(const LocalFeatures& reference, const LocalFeatures& query) const {
  const std::vector<PreparedLayer> prepared = PreparedLayers();
  Tokens tokens = Embed(reference, query);
  std::vector<LightGlueAssignment> assignments;
  for (int i = 0; i < config_.layers; ++i) {
    AttendToSelf(prepared[i], tokens);
    AttendToOther(prepared[i], tokens);
    assignments.push_back(AssignmentOf(i, tokens));
  }
  return assignments;
}

/// log P[i, j] = 2 s[i, j] - log sum_j exp s - log sum_i exp s + log(matchable i) + log(matchable
/// j).
LightGlueAssignment LightGlueImpl::AssignmentOf(int layer, const Tokens& tokens) const {
  const Assignment& assignment = assignments_[layer];
  const auto matchability = Project(assignment.matchability, tokens.states).squeeze(1).to(torch::kFloat);
  const auto certainty = at::log_sigmoid(matchability);
  const auto projected =
      Project(assignment.projection, tokens.states) * std::pow(config_.descriptor_size, -0.25);
  const std::int64_t m = tokens.reference, n = tokens.query();
  const auto similarity = torch::mm(projected.narrow(0, 0, m), projected.narrow(0, m, n).t()).to(torch::kFloat);
  const auto of_row = certainty.narrow(0, 0, m) - similarity.logsumexp(1);
  const auto of_column = certainty.narrow(0, m, n) - similarity.logsumexp(0);
  const auto log_probability = (2 * similarity).add_(of_row.unsqueeze(1)).add_(of_column.unsqueeze(0));
  return {log_probability, matchability.narrow(0, 0, m), matchability.narrow(0, m, n)};
}

LightGlueMatches LightGlueImpl::Assign(int layer, const Tokens& tokens) const {
  const torch::Tensor log_probability = AssignmentOf(layer, tokens).log_probability;
  const auto [best, query] = log_probability.max(1);
  const auto reference = log_probability.argmax(0);

  const auto rows = torch::arange(tokens.reference, query.options());
  const auto scores = best.exp();
  const auto is_match =
      (reference.index_select(0, query) == rows).logical_and_(scores > config_.filter_threshold);
  const auto matched = is_match.nonzero().squeeze(1);
  const auto partner = query.index_select(0, matched) + tokens.reference;
  return {{tokens.features.index_select(0, matched), tokens.features.index_select(0, partner),
           scores.index_select(0, matched)},
          layer + 1};
}

LightGlue LoadLightGlue(const LightGlueConfig& config, const TensorFile& weights,
                        const std::string& source, torch::Device device) {
  LightGlue network(config);
  LoadInto(*network, weights, source);
  network->to(device);
  network->Prepare();
  return network;
}

}  // namespace antipode
