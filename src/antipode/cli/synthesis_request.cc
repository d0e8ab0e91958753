#include "antipode/cli/synthesis_request.h"

#include <CLI/CLI.hpp>

#include "antipode/nn/device.h"
#include "antipode/nn/precision.h"
#include "antipode/render/mesh.h"
#include "antipode/synthesis/mesh_synthesizer.h"
#include "antipode/synthesis/reference_picture.h"
#include "antipode/synthesis/small_synthesizer.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/quote.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

constexpr char kUprightModel[] = "upright";
constexpr char kZero123Model[] = "zero123", kVolumeModel[] = "volume", kAutomatic[] = "auto";
constexpr double kUncertain = 0.8;

std::optional<UprightEstimator> LoadUpright(const std::string& prior_sha256) {
  if (!IsModelInstalled(kUprightModel)) return std::nullopt;
  try {
    return UprightEstimator::Load(kUprightModel, prior_sha256);
  } catch (const BadFile&) {
    return std::nullopt;  // of another prior; whoever needs it says so
  }
}

Zero123SynthesisOptions OptionsOf(const SynthesisRequest& request) {
  Zero123SynthesisOptions options;
  options.sampling = SamplingPreset(request.preset);
  options.sampling.seed = request.seed;
  options.batch = request.batch;
  options.precision = PrecisionOf(request.precision, request.preset);
  options.memory_limit_gb = request.memory_limit_gb;
  return options;
}

}  // namespace

Zero123Options SamplingPreset(const std::string& name) {
  if (name == "fast") return Zero123Options::Fast();
  if (name == "paper") return {};
  throw InvalidOption("--preset", Quoted(name) + " is unknown", "use fast or paper");
}

DenoiserPrecision PrecisionOf(const std::string& name, const std::string& preset) {
  if (name == "float32") return DenoiserPrecision::kFloat32;
  if (name == "bfloat16") return DenoiserPrecision::kBFloat16;
  if (name != "auto") throw InvalidOption("--precision", Quoted(name) + " is unknown", "use auto, float32 or bfloat16");
  return preset == "fast" && ProcessorHasBFloat16() ? DenoiserPrecision::kBFloat16 : DenoiserPrecision::kFloat32;
}

std::string ChosenSynthesisModel(const std::string& name) {
  if (name == kAutomatic) return IsModelInstalled(kZero123Model) ? kZero123Model : kVolumeModel;
  if (name == kZero123Model && !IsModelInstalled(name))
    throw Error("model 'zero123'", "is not installed",
                "get the authors' 105000.ckpt, then: antipode models import zero123 105000.ckpt; or take the built-in model 'volume'");
  return name;
}

std::optional<std::string> WarningOfCoarseViews(const std::string& name) {
  if (name != kAutomatic || IsModelInstalled(kZero123Model)) return std::nullopt;
  return "the views are coarse, of the built-in model 'volume': for a pose --method auto is more accurate; sharper views need the authors' "
         "weights (antipode models import zero123)";
}

void SynthesisRequest::Declare(CLI::App& app, const std::string& group, const std::string& views_option) {
  const auto in_group = [&](CLI::Option* option) {
    if (!group.empty()) option->group(group);
  };
  in_group(app.add_option("--synthesizer", synthesizer, "diffusion: imagine the object from the photograph; mesh: render --mesh")
               ->capture_default_str()->type_name("NAME"));
  in_group(app.add_option("--mesh", mesh, "The object's mesh (.glb, .gltf or what assimp reads); implies --synthesizer mesh")
               ->type_name("FILE"));
  in_group(app.add_option("--synthesis-model", model, "What imagines the views: name or folder of a model; auto: zero123 where it was imported, else the built-in volume")->capture_default_str()->type_name("NAME|FOLDER"));
  in_group(app.add_option("--preset", preset, "fast, or paper: exactly as the paper's program samples")->capture_default_str()->type_name("NAME"));
  in_group(app.add_option("--precision", precision, "float32, bfloat16, or auto: bfloat16 for the preset fast where the processor has it")
               ->capture_default_str()->type_name("NAME"));
  in_group(app.add_option(views_option, views, "Views of the object, on all sides")->capture_default_str()->type_name("N")->check(CLI::Range(8, 1024)));
  in_group(app.add_option("--batch", batch, "Views imagined at a time; memory grows with it")->capture_default_str()->type_name("N"));
  in_group(app.add_option("--memory-limit", memory_limit_gb, "Imagine fewer views at a time where the program would need more memory; 0: no limit")
               ->capture_default_str()->type_name("GB"));
  in_group(app.add_option("--elevation", elevation_deg, "Elevation of the reference camera above the object's horizon, degrees; without: estimated")
               ->type_name("DEG")->check(CLI::Range(-90.0, 90.0)));
  in_group(app.add_option("--in-plane-rotation", in_plane_rotation_deg, "How far the reference picture is turned clockwise, degrees; without: estimated")
               ->type_name("DEG")->check(CLI::Range(-180.0, 180.0)));
}

void SynthesisRequest::Check() const {
  if (!mesh.empty()) return;
  if (IsMesh()) throw InvalidOption("--synthesizer mesh", "has no mesh", "give --mesh object.glb");
  if (synthesizer != "diffusion" && synthesizer != kZero123Model)
    throw InvalidOption("--synthesizer", Quoted(synthesizer) + " is unknown", "use diffusion or mesh");
  SamplingPreset(preset);
  PrecisionOf(precision, preset);
  ChosenSynthesisModel(model);
}

void ViewComparisonRequest::Declare(CLI::App& app, const std::string& group) {
  app.add_option("--selector", selector, "Choose the views with this model instead of with the prior: selector, the built-in one, or gen6d-selector after its import")
      ->type_name("NAME|FOLDER")->group(group);
  app.add_option("--refiner", refiner, "Refine the poses with this model where there are 32 views or more: the built-in one, gen6d-refiner after its import, or none")
      ->capture_default_str()->type_name("NAME|FOLDER")->group(group);
  app.add_option("--refine-iterations", refine_iterations, "Steps of the refiner")->capture_default_str()->type_name("N")
      ->group(group)->check(CLI::Range(0, 100));
}

ReferenceModels ReferenceModels::Load(const std::string& prior, const std::string& device) {
  ReferenceModels models;
  models.prior = std::make_shared<const ObjectPrior>(ObjectPrior::Load(prior, SelectDevice(device)));
  models.identity = {FindModel(prior).sha256};
  models.upright = LoadUpright(models.identity.sha256);
  return models;
}

PhotographOrientation OrientPhotograph(const SynthesisRequest& request, const ReferenceModels& models, const ObjectPhotograph& photograph) {
  PhotographOrientation result;
  if (!request.elevation_deg || !request.in_plane_rotation_deg) {
    if (!models.upright)
      throw Error("orientation", "cannot be estimated without the model 'upright' of this prior",
                  "give --elevation and --in-plane-rotation");
    const std::vector<ObjectView> view{MakeObjectView(photograph.image, photograph.mask, photograph.camera, models.prior->ViewOptions())};
    result.orientation = models.upright->Estimate(models.prior->Encode(view)[0]);
    result.warnings.push_back(Formatted("the camera's elevation is estimated as %.0f degrees, its in-plane rotation as %.0f",
                                        result.orientation.elevation_deg, result.orientation.in_plane_rotation_deg));
    if (result.orientation.certainty < kUncertain)
      result.warnings.emplace_back("which way is up is uncertain; give --elevation and --in-plane-rotation if you know them");
  }
  if (request.elevation_deg) result.orientation.elevation_deg = *request.elevation_deg;
  if (request.in_plane_rotation_deg) result.orientation.in_plane_rotation_deg = *request.in_plane_rotation_deg;
  return result;
}

std::unique_ptr<ViewSynthesizer> SynthesizerOf(const SynthesisRequest& request, const ObjectPhotograph& photograph, double turn_deg) {
  if (!request.mesh.empty())
    throw InvalidOption("--search", "has nothing to search with a mesh", "'antipode pose --mesh' finds the whole pose");
  const ReferencePicture picture = MakeReferencePicture(photograph.image, photograph.mask, photograph.camera, turn_deg);
  return MakeDiffusionSynthesizer(ChosenSynthesisModel(request.model), picture.picture, OptionsOf(request), SelectDevice(request.device));
}

Reference BuildMeshReference(const std::filesystem::path& mesh, int views, const ReferenceModels& models,
                             const std::filesystem::path& folder, const ProgressCallback& progress) {
  const MeshSynthesizer synthesizer(LoadMesh(mesh));
  return BuildReference(synthesizer, RequestViewsAllAround(views, 0), *models.prior, models.identity, std::nullopt, folder, progress);
}

Reference BuildReference(const SynthesisRequest& request, const ReferenceModels& models, const ObjectPhotograph* photograph,
                         const std::filesystem::path& folder, const ProgressCallback& progress) {
  request.Check();
  if (!request.mesh.empty()) return BuildMeshReference(request.mesh, request.views, models, folder, progress);
  const PhotographOrientation oriented = OrientPhotograph(request, models, *photograph);
  const double elevation = oriented.orientation.elevation_deg;
  const ReferencePicture picture =
      MakeReferencePicture(photograph->image, photograph->mask, photograph->camera, oriented.orientation.in_plane_rotation_deg);
  const auto synthesizer = MakeDiffusionSynthesizer(ChosenSynthesisModel(request.model), picture.picture, OptionsOf(request), SelectDevice(request.device));
  Reference reference = BuildReference(*synthesizer, RequestViewsAllAround(request.views, elevation), *models.prior, models.identity,
                                       picture.CameraFromObject(elevation), folder, progress);
  reference.warnings.insert(reference.warnings.end(), oriented.warnings.begin(), oriented.warnings.end());
  if (const auto warning = WarningOfCoarseViews(request.model)) reference.warnings.push_back(*warning);
  return reference;
}

}  // namespace antipode
