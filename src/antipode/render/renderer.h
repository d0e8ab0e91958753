#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "antipode/geometry/camera.h"
#include "antipode/geometry/rigid3.h"
#include "antipode/render/mesh.h"

namespace antipode {

struct RenderOptions {
  int samples_per_side = 2;  ///< n x n rays a pixel on a regular grid, 1..16
  /// Lambert: radiance = light_color * albedo * (ambient + (1 - ambient) * max(0, n . l)), n turned
  /// to the camera; albedo = base colour * texture * vertex colour. 0..1.
  float ambient = 0.5f;
  /// Direction to the light, camera axes (x right, y down, z forward), any length but 0.
  Eigen::Vector3f light_in_camera = {-0.3f, -0.5f, -0.8f};
  Eigen::Vector3f light_color = Eigen::Vector3f::Ones();  ///< linear RGB, not negative

  /// @throws InvalidOption naming the field
  void Check() const;
};

struct Rendering {
  /// 8UC3, RGB, sRGB. The samples of a pixel, white where they miss, are averaged in linear light.
  cv::Mat image;
  cv::Mat mask;  ///< 8UC1 coverage: 255 * (samples that hit) / (samples)
  /// 32FC1, z along the optical axis at the pixel centre; 0 where the ray through the centre meets
  /// no surface or the mask is 0.
  cv::Mat depth;
};

/// Renders one mesh from many cameras by ray casting. Thread safe: `Render` may be called
/// concurrently.
class Renderer {
 public:
  /// @throws Error if the mesh is not sound (Mesh::Check)
  explicit Renderer(Mesh mesh);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  /// The pixel of row i and column j covers [j, j + 1] x [i, i + 1] of `camera`.
  /// @throws InvalidOption if the camera, the pose or an option has an impossible value
  Rendering Render(const PinholeCamera& camera, const Rigid3& camera_from_object,
                   const RenderOptions& options = {}) const;

  /// Only coverage, one ray a pixel: 8UC1, 0 or 255. For finding where the object is.
  cv::Mat RenderMask(const PinholeCamera& camera, const Rigid3& camera_from_object) const;

  const Mesh& mesh() const;

 private:
  struct Scene;
  std::unique_ptr<Scene> scene_;
};

}  // namespace antipode
