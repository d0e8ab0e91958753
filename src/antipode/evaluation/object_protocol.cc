#include "antipode/evaluation/object_protocol.h"

#include <random>

#include "antipode/geometry/look_at.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"

namespace antipode {

void ObjectProtocolOptions::Check() const {
  if (views < 2) throw InvalidOption("views", "leaves no pair to evaluate", "use at least 2");
  if (image_size < 32) throw InvalidOption("image_size", "is too small", "use at least 32 pixels");
  if (!(distance > 1)) throw InvalidOption("distance", "puts the camera inside the object", "use more than 1");
  if (!(field_of_view_deg > 0 && field_of_view_deg < 170))
    throw InvalidOption("field_of_view_deg", "is not an angle of a pinhole camera");
  if (!(least_elevation_deg <= greatest_elevation_deg && least_elevation_deg >= -90 && greatest_elevation_deg <= 90))
    throw InvalidOption("elevation", "is not a range within -90..90 degrees");
}

std::vector<ProtocolView> RenderProtocolViews(const Renderer& renderer, const std::string& object_name,
                                              const ObjectProtocolOptions& options) {
  options.Check();
  std::mt19937_64 random(CombineSeeds(options.seed, HashOfName(object_name)));
  const auto camera = PinholeCamera::FromFieldOfView(options.image_size, options.image_size,
                                                     options.field_of_view_deg);
  std::vector<ProtocolView> views;
  for (int i = 0; i < options.views; ++i) {
    Viewpoint viewpoint;
    viewpoint.azimuth = UniformIn(random, 0, 360);
    viewpoint.elevation = UniformIn(random, options.least_elevation_deg, options.greatest_elevation_deg);
    viewpoint.in_plane_rotation =
        UniformIn(random, -options.in_plane_rotation_deg, options.in_plane_rotation_deg);
    viewpoint.distance = options.distance;
    const Rigid3 camera_from_object = CameraFromObject(viewpoint);
    views.push_back({renderer.Render(camera, camera_from_object), camera, camera_from_object});
  }
  return views;
}

}  // namespace antipode
