#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "antipode/geometry/camera.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/render/renderer.h"

namespace antipode {

/// The paper's protocol on rendered objects (section 4.1): 21 views an object, the first is the reference,
/// the other 20 are queries.
struct ObjectProtocolOptions {
  int views = 21;                    ///< one reference and `views - 1` queries
  int image_size = 256;              ///< pixels, square
  double field_of_view_deg = 40;
  double distance = 3.5;             ///< object radii
  double least_elevation_deg = 0;
  double greatest_elevation_deg = 60;
  double in_plane_rotation_deg = 0;  ///< every camera is rolled by a uniform angle up to this
  std::uint64_t seed = 0;
  void Check() const;
};

struct ProtocolView {
  Rendering rendering;
  PinholeCamera camera;
  Rigid3 camera_from_object;
};

/// Renders the views of one object. They depend on the seed and the object's name only: azimuth uniform,
/// elevation uniform in the range, drawn view by view.
std::vector<ProtocolView> RenderProtocolViews(const Renderer& renderer, const std::string& object_name,
                                              const ObjectProtocolOptions& options);

}  // namespace antipode
