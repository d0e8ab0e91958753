#pragma once

#include <optional>
#include <string>

#include "antipode/geometry/camera.h"

namespace antipode {

/// A camera and where it is known from: "given", "exif" or "assumed".
struct SourcedCamera {
  PinholeCamera camera;
  std::string source;
};

/// Understands `fov=DEG` (longer side), `f=PIXELS`, `fx,fy,cx,cy`, or a file: COLMAP cameras.txt
/// (PINHOLE, SIMPLE_PINHOLE; other models are refused by name) or JSON with fx, fy, cx, cy, width,
/// height or a 3x3 K. Without `spec`: EXIF focal length, else an assumed field of view of 50
/// degrees across the longer side.
/// @throws InvalidOption or BadFile: not finite, not positive, for another image size, unknown model
SourcedCamera ResolveCamera(const std::optional<std::string>& spec, int width, int height,
                            std::optional<double> exif_focal_px);

}  // namespace antipode
