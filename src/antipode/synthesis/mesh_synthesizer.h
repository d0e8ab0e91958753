#pragma once

#include "antipode/geometry/look_at.h"
#include "antipode/render/renderer.h"
#include "antipode/synthesis/view_synthesizer.h"

namespace antipode {

struct MeshSynthesisOptions {
  int size = 256;  ///< side of the pictures, pixels
  /// Where the picture is taken from whose views these are: azimuth, elevation and in-plane rotation, which the views
  /// keep. By default the mesh's own front, so that requests are viewpoints in the mesh's frame.
  Viewpoint picture;
  RenderOptions render;
  void Check() const;
};

/// Renders a mesh instead of imagining an object: what a perfect model would do, and how to find the pose of an object
/// whose mesh is at hand. One object radius is the radius of the mesh's enclosing sphere.
class MeshSynthesizer : public ViewSynthesizer {
 public:
  explicit MeshSynthesizer(Mesh mesh, const MeshSynthesisOptions& options = {});

  std::string Fingerprint() const override;
  SynthesisCamera Camera() const override;
  void Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                  const ProgressCallback& progress = {}) const override;

 private:
  cv::Mat Picture(const RelativeView& view) const;

  MeshSynthesisOptions options_;
  Renderer renderer_;
};

}  // namespace antipode
