#include "zero123_kinds.h"

#include <cmath>
#include <string>

#include "antipode/image/degradation.h"
#include "antipode/nn/synthetic_weights.h"
#include "antipode/synthesis/turned_picture.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"
#include "antipode/zero123/picture.h"
#include "antipode/zero123/zero123.h"
#include "torch_tensors.h"

namespace antipode::golden {
namespace {

using nlohmann::json;

template <typename Network>
Network WithSyntheticWeights(Network network, const std::string& prefix = {}) {
  FillSynthetic(*network, prefix);
  return network;
}

/// Weights stored as the product stores them, so that the cases take its fast path.
void FillDenoiser(Unet& unet) {
  FillSynthetic(*unet);
  UseChannelsLast(*unet);
}

UnetConfig UnetConfigOf(const json& config) {
  UnetConfig result;
  result.input_channels = config.value("in_channels", result.input_channels);
  result.output_channels = config.value("out_channels", result.output_channels);
  result.base_width = config.value("model_channels", result.base_width);
  result.multipliers = config.value("channel_mult", result.multipliers);
  result.residual_blocks = config.value("num_res_blocks", result.residual_blocks);
  result.attention_factors = config.value("attention_resolutions", result.attention_factors);
  result.heads = config.value("num_heads", result.heads);
  result.transformer_depth = config.value("transformer_depth", result.transformer_depth);
  result.context_width = config.value("context_dim", result.context_width);
  return result;
}

AutoencoderConfig AutoencoderConfigOf(const json& config) {
  AutoencoderConfig result;
  result.image_channels = config.value("in_channels", result.image_channels);
  result.latent_channels = config.value("z_channels", result.latent_channels);
  result.base_width = config.value("ch", result.base_width);
  result.multipliers = config.value("ch_mult", result.multipliers);
  result.residual_blocks = config.value("num_res_blocks", result.residual_blocks);
  return result;
}

ClipConfig ClipConfigOf(const json& config) {
  ClipConfig result;
  result.width = config.value("width", result.width);
  result.layers = config.value("layers", result.layers);
  result.heads = config.value("heads", result.heads);
  result.patch = config.value("patch", result.patch);
  result.output_width = config.value("output", result.output_width);
  result.image_size = config.value("input_resolution", result.image_size);
  return result;
}

std::vector<RelativeView> Viewpoints(const GoldenCase& golden_case) {
  std::vector<RelativeView> viewpoints;
  for (const json& pose : golden_case.generated_inputs.at("poses_deg_xyz"))
    viewpoints.push_back({pose.at(0), pose.at(1), pose.at(2)});
  return viewpoints;
}

torch::Tensor Timesteps(const GoldenCase& golden_case) {
  return torch::tensor(golden_case.generated_inputs.at("timesteps").get<std::vector<double>>(), torch::kDouble).to(torch::kFloat);
}

/// The layers by the names that the case gives them, each with its input and its synthetic weights.
NumericTensors Units(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  const std::int64_t channels = golden_case.config.at("channels");
  Recorder recorder(golden_case);
  const auto input = [&](const std::string& key) { return GeneratedTensor(golden_case, key); };
  const auto run = [&](const std::string& layer, auto module, const std::string& key) {
    recorder.Add(layer, WithSyntheticWeights(module, "unit." + layer + ".")->forward(input(key)));
  };
  run("gn_unet_resblock", GroupNormalization(channels, 1e-5), "small");
  run("gn_unet_transformer", GroupNormalization(channels, 1e-6), "small");
  run("gn_vae", GroupNormalization(channels, 1e-6), "small");
  run("ln_unet", LayerNormalization(channels), "smalltok");
  run("ln_clip", LayerNormalization(channels), "smalltok");
  run("geglu", GatedGelu(channels, 4 * channels), "tok");
  run("unet_downsample", UnetDownsampling(channels), "xe");
  run("unet_upsample", Upsampling(channels), "x");
  run("vae_downsample", AutoencoderDownsampling(channels), "xe");
  run("vae_upsample", Upsampling(channels), "x");
  run("vae_attn", PixelAttention(channels), "x");
  run("vae_resnet", AutoencoderResidualBlock(channels, 2 * channels), "x");
  recorder.Add("quickgelu", QuickGelu(3 * input("tok")));
  recorder.Add("silu", at::silu(3 * input("tok")));
  constexpr int kHeads = 4;
  const auto context = input("ctx");
  const auto attention = WithSyntheticWeights(CrossAttention(channels, context.size(2), kHeads), "unit.crossattn.");
  recorder.Add("crossattn", attention->forward(input("tok"), context));
  return recorder.Take();
}

NumericTensors TimestepEmbeddings(const GoldenCase& golden_case) {
  Recorder recorder(golden_case);
  for (const std::int64_t width : golden_case.config.at("dims").get<std::vector<std::int64_t>>())
    recorder.Add("dim" + std::to_string(width), TimestepEmbedding(Timesteps(golden_case), width));
  return recorder.Take();
}

NumericTensors PoseProjections(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  Recorder recorder(golden_case);
  const auto poses = PoseVector(Viewpoints(golden_case));
  const auto embedding = GeneratedTensor(golden_case, "clip_embedding");
  recorder.Add("T", poses);
  recorder.Add("out", WithSyntheticWeights(PoseProjection(embedding.size(2)))->forward(embedding, poses));
  return recorder.Take();
}

NumericTensor ListOf(const std::vector<double>& values) {
  NumericTensor tensor({static_cast<std::int64_t>(values.size())});
  tensor.values = values;
  return tensor;
}

NumericTensors Schedules(const GoldenCase& golden_case) {
  const NoiseSchedule schedule;
  const double eta = golden_case.config.value("eta", 1.0);
  std::vector<double> timesteps, alphas, alphas_before, deviations, noises;
  DiffusionTime before = schedule.At(0);
  for (const int timestep : schedule.PublishedTable(golden_case.config.at("ddim_steps"))) {
    const DiffusionTime time = schedule.At(timestep);
    timesteps.push_back(timestep);
    alphas.push_back(time.alpha_bar);
    alphas_before.push_back(before.alpha_bar);
    deviations.push_back(DdimDeviation(time, before, eta));
    noises.push_back(std::sqrt(1 - time.alpha_bar));
    before = time;
  }
  return {{"ddim_timesteps", ListOf(timesteps)},
          {"ddim_alphas", ListOf(alphas)},
          {"ddim_alphas_prev", ListOf(alphas_before)},
          {"ddim_sigmas_eta1", ListOf(deviations)},
          {"ddim_sqrt_one_minus_alphas", ListOf(noises)},
          {"betas", ListOf(schedule.betas())},
          {"alphas_cumprod", ListOf(schedule.alpha_bars())}};
}

NumericTensors UnetForward(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  Unet unet(UnetConfigOf(golden_case.config));
  FillDenoiser(unet);
  Recorder recorder(golden_case);
  const UnetContext context = unet->Prepare(GeneratedTensor(golden_case, "context"));
  recorder.Add("out", unet->forward(GeneratedTensor(golden_case, "x"), Timesteps(golden_case), context, recorder.Look()));
  return recorder.Take();
}

NumericTensors AutoencoderForward(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  const auto autoencoder = WithSyntheticWeights(Autoencoder(AutoencoderConfigOf(golden_case.config)));
  Recorder recorder(golden_case);
  const auto image = GeneratedTensor(golden_case, "image");
  recorder.Add("moments", autoencoder->Moments(image, recorder.Look()));
  recorder.Add("mode", autoencoder->Encode(image));
  recorder.Add("decoded", autoencoder->Decode(GeneratedTensor(golden_case, "z"), recorder.Look()));
  return recorder.Take();
}

NumericTensors ClipForward(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  const auto clip = WithSyntheticWeights(ClipImageTower(ClipConfigOf(golden_case.config)));
  Recorder recorder(golden_case);
  recorder.Add("embedding", clip->forward(GeneratedTensor(golden_case, "image"), recorder.Look()));
  return recorder.Take();
}

Zero123Options SamplingOptions(const json& config) {
  Zero123Options options;
  options.steps = config.at("ddim_steps");
  options.eta = config.at("eta");
  options.guidance_scale = config.at("guidance_scale");
  return options;
}

/// Samples with the noise of the case. Shows the start noise, the noise added and what the sampler shows.
torch::Tensor SampleWithStoredNoise(const Zero123& model, const ViewConditioning& views, const GoldenCase& golden_case,
                                    Recorder& recorder) {
  const Zero123Options options = SamplingOptions(golden_case.config);
  const SamplerInput times = TimesOf(options, model.schedule);
  const auto start = GeneratedTensor(golden_case, "x_T");
  recorder.Add("noise.xT", start);
  const auto added = [&](int step) {
    const auto noise = GeneratedTensor(golden_case, "per_step_noise", step);
    recorder.Add("noise.step" + std::to_string(step), noise);
    return noise;
  };
  const auto predict = model.Predictor(views, options, static_cast<int>(times.times.size()), recorder.Look());
  return Sample(options.solver, predict, start, times, added, recorder.Look());
}

/// The parts that a case does without stay without weights and are not used.
NumericTensors DdimSampling(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  Zero123 model({.unet = UnetConfigOf(golden_case.config.at("unet"))});
  FillDenoiser(model.unet);
  const auto tokens = GeneratedTensor(golden_case, "c_crossattn");
  const ViewConditioning views{GeneratedTensor(golden_case, "c_concat"),
                               model.unet->Prepare(at::cat({at::zeros_like(tokens), tokens})), model.unet->Prepare(tokens)};
  Recorder recorder(golden_case);
  recorder.Add("samples", SampleWithStoredNoise(model, views, golden_case, recorder));
  return recorder.Take();
}

torch::Tensor Bytes(const std::vector<cv::Mat>& pictures) {
  std::vector<torch::Tensor> tensors;
  for (const cv::Mat& picture : pictures)
    tensors.push_back(torch::from_blob(picture.data, {picture.rows, picture.cols, 3}, torch::kByte).clone());
  return at::stack(tensors);  // [P, H, W, 3]
}

NumericTensors Pipeline(const GoldenCase& golden_case) {
  const torch::InferenceMode inference;
  Zero123 model({.unet = UnetConfigOf(golden_case.config.at("unet"))});
  FillDenoiser(model.unet);
  FillSynthetic(*model.autoencoder);
  FillSynthetic(*model.clip);
  FillSynthetic(*model.projection);
  Recorder recorder(golden_case);
  const PictureConditioning picture = model.Condition(GeneratedTensor(golden_case, "image"));
  recorder.Add("clip_embedding", picture.embedding);
  recorder.Add("c_concat", picture.latent);
  const auto latents = SampleWithStoredNoise(model, model.Prepare(picture, Viewpoints(golden_case)), golden_case, recorder);
  recorder.Add("latents", latents);
  const auto images = model.Decode(latents);
  recorder.Add("images", images);
  recorder.Add("images_u8_truncated", Bytes(PicturesOf(images)).permute({0, 3, 1, 2}));
  return recorder.Take();
}

/// An ellipse of coloured 8 x 8 blocks on white, in whole numbers only.
cv::Mat SyntheticPhoto(const json& input) {
  const std::int64_t height = input.at("shape").at(0), width = input.at("shape").at(1);
  const std::uint64_t seed = HashOfName(input.at("name").get<std::string>());
  const std::int64_t blocks = (width + 7) / 8;
  cv::Mat photo(static_cast<int>(height), static_cast<int>(width), CV_8UC3, cv::Scalar::all(255));
  for (std::int64_t y = 0; y < height; ++y) {
    for (std::int64_t x = 0; x < width; ++x) {
      const std::int64_t across = (2 * x + 1 - width) * 5 * height, along = (2 * y + 1 - height) * 6 * width;
      if (across * across + along * along >= 16 * height * height * width * width) continue;
      for (std::int64_t c = 0; c < 3; ++c) {
        const auto index = static_cast<std::uint64_t>(((y / 8) * blocks + x / 8) * 3 + c);
        photo.at<cv::Vec3b>(static_cast<int>(y), static_cast<int>(x))[static_cast<int>(c)] =
            static_cast<std::uint8_t>(CombineSeeds(seed, index) >> 56);
      }
    }
  }
  return photo;
}

cv::Mat PhotoOf(const GoldenCase& golden_case) { return SyntheticPhoto(golden_case.generated_inputs.at("image")); }

NumericTensors Preprocessing(const GoldenCase& golden_case) {
  Recorder recorder(golden_case);
  const json& config = golden_case.config;
  recorder.Add("canvas_u8", Bytes({PrepareReferencePicture(PhotoOf(golden_case), config.value("shrink_to", 220),
                                                           config.value("canvas", 256))})[0]);
  return recorder.Take();
}

NumericTensors InPlaneRotations(const GoldenCase& golden_case) {
  Recorder recorder(golden_case);
  const cv::Mat photo = PhotoOf(golden_case);
  const auto angles = golden_case.config.at("angles_deg").get<std::vector<double>>();
  const std::vector<TurnedPicture> candidates = TurnPictures(photo, angles);
  recorder.Add("padded", Bytes({TurnedOnWhite(photo, 0)})[0]);
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const std::string angle = std::to_string(static_cast<int>(angles[i]));
    recorder.Add("angle_" + angle, Bytes({candidates[i].padded})[0]);
    recorder.Add("rotated_uncropped_" + angle, Bytes({TurnedOnWhite(photo, angles[i])})[0]);
  }
  return recorder.Take();
}

NumericTensors JpegGenerations(const GoldenCase& golden_case) {
  Recorder recorder(golden_case);
  cv::Mat picture = PhotoOf(golden_case);
  for (int generation = 1; golden_case.Lists("after_" + std::to_string(generation)); ++generation) {
    picture = AfterJpeg(picture, golden_case.config.at("quality"));
    recorder.Add("after_" + std::to_string(generation), Bytes({picture})[0]);
  }
  return recorder.Take();
}

}  // namespace

std::vector<CatalogueEntry> Zero123Kinds() {
  return {{"units", {"gn_unet_resblock", "geglu"}, Units},
          {"timestep_embedding", {}, TimestepEmbeddings},
          {"cc_projection", {"T", "out"}, PoseProjections},
          {"schedule", {"ddim_timesteps", "ddim_alphas"}, Schedules},
          {"unet", {"out", "middle_block"}, UnetForward},
          {"vae", {"moments", "decoded"}, AutoencoderForward},
          {"clip", {"ln_pre", "embedding"}, ClipForward},
          {"ddim", {"samples", "noise.xT"}, DdimSampling},
          {"pipeline", {"clip_embedding", "latents"}, Pipeline},
          {"preprocess", {"canvas_u8"}, Preprocessing},
          {"inplane_rotation", {"padded"}, InPlaneRotations},
          {"jpeg", {"after_1"}, JpegGenerations}};
}

}  // namespace antipode::golden
