#include "antipode/training/posed_objects.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/render/mesh_collection.h"
#include "antipode/render/renderer.h"
#include "antipode/synthesis/mesh_synthesizer.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

QueryGroup RandomGroup(const Renderer& renderer, const PosedObjectOptions& options, std::mt19937_64& random) {
  const auto uniform = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const double field_of_view = uniform(20, 55);
  const PinholeCamera camera = PinholeCamera::FromFieldOfView(options.image_size, options.image_size, field_of_view);
  // The enclosing sphere fills half to nearly all of the picture.
  const double distance = 1 / std::sin(0.5 * RadiansFromDegrees(field_of_view) * uniform(0.55, 0.85));
  const Rigid3 coarse = CameraFromObject({.azimuth = uniform(0, 360), .elevation = uniform(-40, 80),
                                          .in_plane_rotation = uniform(-options.greatest_roll_deg, options.greatest_roll_deg),
                                          .distance = distance});
  QueryGroup group{ToCanonicalFrame(coarse), {}};
  for (int i = 0; i < options.queries_per_group; ++i) {
    const Eigen::Vector3d axis = RandomRotation(random).col(0);
    const Eigen::Matrix3d turn = RotationFromVector(axis * RadiansFromDegrees(uniform(0, options.greatest_error_deg)));
    const Eigen::Vector3d shift(uniform(-0.1, 0.1), uniform(-0.1, 0.1), 0);
    const Rigid3 pose{turn * coarse.rotation, std::exp2(uniform(-0.2, 0.2)) * (coarse.translation + shift)};
    RenderOptions render;
    render.ambient = static_cast<float>(uniform(0.3, 0.8));
    render.light_in_camera = Eigen::Vector3f(static_cast<float>(uniform(-1, 1)), static_cast<float>(uniform(-1, 0.3)), -0.8f);
    group.queries.push_back(ToPosedPicture(renderer.Render(camera, pose, render).image, camera, pose));
  }
  return group;
}

PosedObject RenderPosedObject(Mesh mesh, const PosedObjectOptions& options, std::mt19937_64& random) {
  PosedObject object;
  MeshSynthesisOptions synthesis;
  synthesis.size = options.image_size;
  MeshSynthesizer(mesh, synthesis).Synthesize(RequestViewsAllAround(options.views, 0), [&](const SynthesizedView& view) {
    object.views.push_back(ToPosedPicture(view.image, view.camera, view.camera_from_object));
  });
  mesh.Normalize();
  const Renderer renderer(std::move(mesh));
  for (int i = 0; i < options.query_groups; ++i) object.groups.push_back(RandomGroup(renderer, options, random));
  return object;
}

}  // namespace

void PosedObjectOptions::Check() const {
  if (views < 8 || views > 256) throw InvalidOption("views", "is " + std::to_string(views), "use 8 to 256");
  if (query_groups < 1 || queries_per_group < 1) throw InvalidOption("queries", "must be at least 1");
  if (!(greatest_error_deg >= 0 && greatest_error_deg <= 90)) throw InvalidOption("greatest_error", "must be 0 to 90 degrees");
  if (image_size < 64 || image_size > 1024) throw InvalidOption("image_size", "is " + std::to_string(image_size), "use 64 to 1024");
  if (!(greatest_roll_deg >= 0 && greatest_roll_deg <= 90)) throw InvalidOption("greatest_roll", "must be 0 to 90 degrees");
}

std::vector<PosedObject> RenderPosedObjects(const std::filesystem::path& meshes, const PosedObjectOptions& options,
                                            const ProgressCallback& progress) {
  options.Check();
  const MeshCollection collection = MeshCollection::Open(meshes);
  std::vector<std::size_t> order(collection.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::mt19937_64 random(options.seed);
  std::ranges::shuffle(order, random);
  if (options.most_objects > 0) order.resize(std::min(order.size(), static_cast<std::size_t>(options.most_objects)));
  std::vector<PosedObject> objects;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (progress) progress({"rendering objects", static_cast<std::int64_t>(i), static_cast<std::int64_t>(order.size()), {}});
    std::mt19937_64 own(CombineSeeds(options.seed, i));
    objects.push_back(RenderPosedObject(collection.Load(order[i]), options, own));
  }
  return objects;
}

}  // namespace antipode
