#include "antipode/render/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "antipode/render/ray_caster.h"
#include "antipode/render/srgb.h"
#include "antipode/render/texture_pyramid.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

// Pixels a side of the blocks that are rendered one after the other: small enough for the cache,
// and a multiple of kPacketSide whatever the number of samples.
constexpr int kTileSide = 8;
constexpr int kTilePixels = kTileSide * kTileSide;
constexpr int kPacketSide = 4;  // a packet is a square of samples
constexpr float kSmallestCosine = 0.1f;
static_assert(kPacketSide * kPacketSide == kPacketSize && kTileSide % kPacketSide == 0);

void Require(bool condition, const char* field, const char* problem) {
  if (!condition) throw InvalidOption(field, problem);
}

void CheckPose(const Rigid3& camera_from_object) {
  const Eigen::Matrix3d& rotation = camera_from_object.rotation;
  const bool orthonormal =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3 &&
      rotation.determinant() > 0;
  Require(orthonormal, "camera_from_object", "must have a rotation matrix");
  Require(camera_from_object.translation.allFinite(), "camera_from_object",
          "must have a finite translation");
}

/// The camera as its rays are in the object frame.
struct View {
  Eigen::Vector3f origin;
  // The ray through (x, y) of the image is corner + x * right + y * down. Its depth is 1, so that
  // distances along it are depths.
  Eigen::Vector3f corner;
  Eigen::Vector3f right;
  Eigen::Vector3f down;

  View(const PinholeCamera& camera, const Rigid3& camera_from_object)
      : origin(camera_from_object.OriginInSource().cast<float>()) {
    const Eigen::Matrix3d object_from_camera = camera_from_object.rotation.transpose();
    corner = (object_from_camera * camera.Ray({0, 0})).cast<float>();
    right = (object_from_camera.col(0) / camera.fx).cast<float>();
    down = (object_from_camera.col(1) / camera.fy).cast<float>();
  }

  Eigen::Vector3f Direction(float x, float y) const { return corner + x * right + y * down; }
};

void SetRay(const Eigen::Vector3f& direction, int lane, RayPacket& rays) {
  rays.active[lane] = -1;
  rays.x[lane] = direction.x();
  rays.y[lane] = direction.y();
  rays.z[lane] = direction.z();
}

Eigen::Vector3f RayOf(const RayPacket& rays, int lane) {
  return {rays.x[lane], rays.y[lane], rays.z[lane]};
}

/// The samples of a rectangle of pixels, `samples_per_side` squared in each.
struct SampleGrid {
  cv::Rect pixels;
  int samples_per_side;

  int rows() const { return pixels.height * samples_per_side; }
  int columns() const { return pixels.width * samples_per_side; }

  /// The square of samples that begins at `row`, `column`.
  RayPacket PacketAt(int row, int column, const View& view) const {
    RayPacket rays;
    const float step = 1.f / static_cast<float>(samples_per_side);
    for (int lane = 0; lane < kPacketSize; ++lane) {
      const int i = row + lane / kPacketSide, j = column + lane % kPacketSide;
      const float x = static_cast<float>(pixels.x) + step * (static_cast<float>(j) + 0.5f);
      const float y = static_cast<float>(pixels.y) + step * (static_cast<float>(i) + 0.5f);
      SetRay(view.Direction(x, y), lane, rays);
      if (i >= rows() || j >= columns()) rays.active[lane] = 0;
    }
    return rays;
  }
};

/// Calls `visit(grid)` for each tile of the rectangle.
template <typename Visit>
void ForEachTile(const cv::Rect& pixels, int samples_per_side, const Visit& visit) {
  for (int y = pixels.y; y < pixels.br().y; y += kTileSide) {
    for (int x = pixels.x; x < pixels.br().x; x += kTileSide) {
      visit(SampleGrid{cv::Rect(x, y, kTileSide, kTileSide) & pixels, samples_per_side});
    }
  }
}

/// Calls `visit(row, column)` for the first sample of each packet of a tile.
template <typename Visit>
void ForEachPacket(const SampleGrid& grid, const Visit& visit) {
  for (int row = 0; row < grid.rows(); row += kPacketSide) {
    for (int column = 0; column < grid.columns(); column += kPacketSide) visit(row, column);
  }
}

/// The pixels that the mesh may cover: the bounding box of its projected vertices, one pixel wider
/// on each side, or the whole image if a vertex is beside or behind the camera.
cv::Rect PixelsAround(const Mesh& mesh, const PinholeCamera& camera,
                      const Rigid3& camera_from_object) {
  const cv::Rect image(0, 0, camera.width, camera.height);
  const Eigen::Matrix3f rotation = camera_from_object.rotation.cast<float>();
  const Eigen::Vector3f translation = camera_from_object.translation.cast<float>();
  Eigen::Array2f low = Eigen::Array2f::Constant(std::numeric_limits<float>::max());
  Eigen::Array2f high = -low;
  for (const Eigen::Vector3f& position : mesh.positions) {
    const Eigen::Vector3f point = rotation * position + translation;
    if (point.z() < 1e-4f) return image;
    const Eigen::Array2f ray = point.head<2>().array() / point.z();
    low = low.min(ray);
    high = high.max(ray);
  }
  const Eigen::Array2d focal(camera.fx, camera.fy), centre(camera.cx, camera.cy);
  const Eigen::Array2d size(camera.width, camera.height);
  const Eigen::Array2d first = (low.cast<double>() * focal + centre).floor() - 1;
  const Eigen::Array2d last = (high.cast<double>() * focal + centre).ceil() + 1;
  const Eigen::Array2i begin = first.max(0).min(size).cast<int>();
  const Eigen::Array2i end = last.max(0).min(size).cast<int>();
  return cv::Rect(cv::Point(begin.x(), begin.y()), cv::Point(end.x(), end.y())) & image;
}

/// What shading asks of a triangle, worked out once.
struct Facet {
  Eigen::Vector3f normal;  // by the winding, unit; zero if the triangle has no area
  float texels_per_area;   // texels of its texture on one square unit of surface
};

Facet FacetOf(const Mesh& mesh, const Eigen::Matrix<std::uint32_t, 3, 1>& triangle,
              float texel_count) {
  const Eigen::Vector3f& origin = mesh.positions[triangle[0]];
  const Eigen::Vector3f across =
      (mesh.positions[triangle[1]] - origin).cross(mesh.positions[triangle[2]] - origin);
  const float area = across.norm();
  Facet facet{across.stableNormalized(), 0};
  if (mesh.texcoords.empty() || area <= 0) return facet;
  const Eigen::Vector2f a = mesh.texcoords[triangle[1]] - mesh.texcoords[triangle[0]];
  const Eigen::Vector2f b = mesh.texcoords[triangle[2]] - mesh.texcoords[triangle[0]];
  facet.texels_per_area = std::abs(a.x() * b.y() - a.y() * b.x()) * texel_count / area;
  return facet;
}

struct Shading {
  Eigen::Vector3f to_light;  // object frame, unit
  Eigen::Vector3f ambient;
  Eigen::Vector3f diffuse;
  float sample_area;  // square units of a surface facing the camera at depth 1

  Shading(const PinholeCamera& camera, const Rigid3& camera_from_object,
          const RenderOptions& options)
      : to_light(camera_from_object.rotation.transpose().cast<float>() *
                 options.light_in_camera.stableNormalized()),
        ambient(options.ambient * options.light_color),
        diffuse((1 - options.ambient) * options.light_color) {
    const double focal_area = camera.fx * camera.fy;
    const int samples = options.samples_per_side * options.samples_per_side;
    sample_area = static_cast<float>(1 / (focal_area * samples));
  }
};

/// The samples of one pixel.
struct PixelSum {
  Eigen::Vector3f color = Eigen::Vector3f::Zero();  // linear, of the samples that hit
  int hits = 0;
  std::uint32_t triangle = kNoTriangle;  // the one that the first sample met
  bool one_triangle = true;              // every sample that hit met it

  void Add(const Eigen::Vector3f& radiance, std::uint32_t triangle_hit) {
    if (hits == 0) triangle = triangle_hit;
    one_triangle = one_triangle && triangle == triangle_hit;
    color += radiance;
    ++hits;
  }
};

using Tile = std::array<PixelSum, kTilePixels>;

bool AnyHit(const HitPacket& hits) {
  return std::any_of(hits.triangle.begin(), hits.triangle.end(),
                     [](std::uint32_t triangle) { return triangle != kNoTriangle; });
}

}  // namespace

void RenderOptions::Check() const {
  Require(samples_per_side >= 1 && samples_per_side <= 16, "samples_per_side", "must be 1..16");
  Require(ambient >= 0 && ambient <= 1, "ambient", "must be 0..1");
  Require(light_in_camera.allFinite() && !light_in_camera.isZero(0), "light_in_camera",
          "must be finite and not zero");
  Require(light_color.allFinite() && light_color.minCoeff() >= 0, "light_color",
          "must be finite and not negative");
}

struct Renderer::Scene {
  explicit Scene(Mesh sound_mesh);

  Eigen::Vector3f Radiance(const Shading& shading, const Eigen::Vector3f& direction,
                           const HitPacket& hits, int lane) const;
  Tile SampleTile(const View& view, const Shading& shading, const SampleGrid& grid) const;
  void Resolve(const Tile& tile, const SampleGrid& grid, Rendering& rendering) const;
  void FillDepth(const Tile& tile, const View& view, const SampleGrid& grid, cv::Mat& depth) const;
  float DepthOnPlane(std::uint32_t triangle, const View& view,
                     const Eigen::Vector3f& direction) const;

  Mesh mesh;
  SrgbTables tables;
  RayCaster caster;
  std::vector<TexturePyramid> textures;  // one a material
  std::vector<Facet> facets;             // one a triangle
};

Renderer::Scene::Scene(Mesh sound_mesh) : mesh(std::move(sound_mesh)), caster(mesh) {
  for (const Material& material : mesh.materials) textures.emplace_back(material.texture, tables);
  facets.reserve(mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const TexturePyramid& texture = textures[mesh.triangle_materials[i]];
    facets.push_back(FacetOf(mesh, mesh.triangles[i], texture.TexelCount()));
  }
}

Eigen::Vector3f Renderer::Scene::Radiance(const Shading& shading, const Eigen::Vector3f& direction,
                                          const HitPacket& hits, int lane) const {
  const std::uint32_t index = hits.triangle[lane];
  const auto& triangle = mesh.triangles[index];
  const float u = hits.u[lane], v = hits.v[lane];
  const auto interpolated = [&](const auto& values) {
    using Vector = typename std::remove_reference_t<decltype(values)>::value_type;
    return Vector((1 - u - v) * values[triangle[0]] + u * values[triangle[1]] +
                  v * values[triangle[2]]);
  };
  const Facet& facet = facets[index];
  const float facing = facet.normal.dot(direction);  // positive if the back is seen
  Eigen::Vector3f normal = interpolated(mesh.normals);
  if (normal.dot(facet.normal) * facing > 0) normal = -normal;
  const float lambert = normal.dot(shading.to_light) / std::max(normal.norm(), 1e-20f);

  const std::uint16_t material = mesh.triangle_materials[index];
  Eigen::Vector3f albedo = mesh.materials[material].base_color;
  if (!mesh.colors.empty()) albedo = albedo.cwiseProduct(interpolated(mesh.colors));
  if (!textures[material].empty() && !mesh.texcoords.empty()) {
    const float depth = hits.distance[lane];
    const float cosine = std::max(std::abs(facing) / direction.norm(), kSmallestCosine);
    const float surface_area = shading.sample_area * depth * depth / cosine;
    albedo = albedo.cwiseProduct(textures[material].ColorAt(interpolated(mesh.texcoords),
                                                            facet.texels_per_area * surface_area));
  }
  return albedo.cwiseProduct(shading.ambient + std::max(lambert, 0.f) * shading.diffuse);
}

Tile Renderer::Scene::SampleTile(const View& view, const Shading& shading,
                                 const SampleGrid& grid) const {
  Tile tile;
  ForEachPacket(grid, [&](int row, int column) {
    const RayPacket rays = grid.PacketAt(row, column, view);
    const HitPacket hits = caster.NearestHits(view.origin, rays);
    if (!AnyHit(hits)) return;
    for (int lane = 0; lane < kPacketSize; ++lane) {
      if (hits.triangle[lane] == kNoTriangle) continue;
      const int i = (row + lane / kPacketSide) / grid.samples_per_side;
      const int j = (column + lane % kPacketSide) / grid.samples_per_side;
      tile[i * kTileSide + j].Add(Radiance(shading, RayOf(rays, lane), hits, lane),
                                  hits.triangle[lane]);
    }
  });
  return tile;
}

void Renderer::Scene::Resolve(const Tile& tile, const SampleGrid& grid,
                              Rendering& rendering) const {
  const int samples = grid.samples_per_side * grid.samples_per_side;
  for (int i = 0; i < grid.pixels.height; ++i) {
    auto* image = rendering.image.ptr<cv::Vec3b>(grid.pixels.y + i) + grid.pixels.x;
    auto* mask = rendering.mask.ptr<std::uint8_t>(grid.pixels.y + i) + grid.pixels.x;
    for (int j = 0; j < grid.pixels.width; ++j) {
      const PixelSum& pixel = tile[i * kTileSide + j];
      if (pixel.hits == 0) continue;
      const auto white = static_cast<float>(samples - pixel.hits);
      for (int c = 0; c < 3; ++c) {
        image[j][c] = tables.Encoded((pixel.color[c] + white) / static_cast<float>(samples));
      }
      mask[j] = static_cast<std::uint8_t>((255 * pixel.hits + samples / 2) / samples);
    }
  }
}

float Renderer::Scene::DepthOnPlane(std::uint32_t triangle, const View& view,
                                    const Eigen::Vector3f& direction) const {
  const Eigen::Vector3f& normal = facets[triangle].normal;
  const Eigen::Vector3f& point = mesh.positions[mesh.triangles[triangle][0]];
  return normal.dot(point - view.origin) / normal.dot(direction);
}

void Renderer::Scene::FillDepth(const Tile& tile, const View& view, const SampleGrid& grid,
                                cv::Mat& depth) const {
  const int samples = grid.samples_per_side * grid.samples_per_side;
  RayPacket rays;
  std::array<float*, kPacketSize> targets;
  int waiting = 0;
  const auto cast = [&] {
    const HitPacket hits = caster.NearestHits(view.origin, rays);
    for (int lane = 0; lane < waiting; ++lane) {
      if (hits.triangle[lane] != kNoTriangle) *targets[lane] = hits.distance[lane];
    }
    rays = RayPacket{};
    waiting = 0;
  };
  for (int i = 0; i < grid.pixels.height; ++i) {
    for (int j = 0; j < grid.pixels.width; ++j) {
      const PixelSum& pixel = tile[i * kTileSide + j];
      if (pixel.hits == 0) continue;
      const int x = grid.pixels.x + j, y = grid.pixels.y + i;
      const Eigen::Vector3f direction = view.Direction(x + 0.5f, y + 0.5f);
      float& target = depth.at<float>(y, x);
      // Where every sample of the pixel met the same triangle, so does its centre.
      if (pixel.hits == samples && pixel.one_triangle) {
        target = DepthOnPlane(pixel.triangle, view, direction);
        continue;
      }
      targets[waiting] = &target;
      SetRay(direction, waiting++, rays);
      if (waiting == kPacketSize) cast();
    }
  }
  if (waiting > 0) cast();
}

Renderer::Renderer(Mesh mesh) {
  mesh.Check();
  scene_ = std::make_unique<Scene>(std::move(mesh));
}

Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

Rendering Renderer::Render(const PinholeCamera& camera, const Rigid3& camera_from_object,
                           const RenderOptions& options) const {
  options.Check();
  camera.Check();
  CheckPose(camera_from_object);
  const View view(camera, camera_from_object);
  const Shading shading(camera, camera_from_object, options);
  Rendering rendering{cv::Mat(camera.height, camera.width, CV_8UC3, cv::Scalar::all(255)),
                      cv::Mat::zeros(camera.height, camera.width, CV_8UC1),
                      cv::Mat::zeros(camera.height, camera.width, CV_32FC1)};
  const cv::Rect pixels = PixelsAround(scene_->mesh, camera, camera_from_object);
  ForEachTile(pixels, options.samples_per_side, [&](const SampleGrid& grid) {
    const Tile tile = scene_->SampleTile(view, shading, grid);
    scene_->Resolve(tile, grid, rendering);
    scene_->FillDepth(tile, view, grid, rendering.depth);
  });
  return rendering;
}

cv::Mat Renderer::RenderMask(const PinholeCamera& camera, const Rigid3& camera_from_object) const {
  camera.Check();
  CheckPose(camera_from_object);
  const View view(camera, camera_from_object);
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  const cv::Rect pixels = PixelsAround(scene_->mesh, camera, camera_from_object);
  ForEachTile(pixels, 1, [&](const SampleGrid& grid) {
    ForEachPacket(grid, [&](int row, int column) {
      const auto hits = scene_->caster.AnyHits(view.origin, grid.PacketAt(row, column, view));
      for (int lane = 0; lane < kPacketSize; ++lane) {
        if (!hits[lane]) continue;
        mask.at<std::uint8_t>(grid.pixels.y + row + lane / kPacketSide,
                              grid.pixels.x + column + lane % kPacketSide) = 255;
      }
    });
  });
  return mask;
}

const Mesh& Renderer::mesh() const { return scene_->mesh; }

}  // namespace antipode
