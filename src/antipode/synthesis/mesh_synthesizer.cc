#include "antipode/synthesis/mesh_synthesizer.h"

#include <cmath>
#include <utility>

#include "antipode/image/load.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"

namespace antipode {
namespace {

constexpr double kSphereShare = 0.86;  // of the picture's side that the enclosing sphere spans

Mesh Normalized(Mesh mesh) {
  mesh.Normalize();
  return mesh;
}

std::span<const std::byte> BytesOf(const auto& values) { return std::as_bytes(std::span(values)); }

}  // namespace

void MeshSynthesisOptions::Check() const {
  if (size < 32 || size > 4096) throw InvalidOption("size", "is " + std::to_string(size), "use 32 to 4096");
  render.Check();
}

MeshSynthesizer::MeshSynthesizer(Mesh mesh, const MeshSynthesisOptions& options)
    : options_(options), renderer_(Normalized(std::move(mesh))) {
  options.Check();
}

std::string MeshSynthesizer::Fingerprint() const {
  const Mesh& mesh = renderer_.mesh();
  std::string text = "mesh " + Sha256Hex(BytesOf(mesh.positions)) + Sha256Hex(BytesOf(mesh.triangles)) +
                     Sha256Hex(BytesOf(mesh.colors));
  for (const Material& material : mesh.materials) {
    text += Sha256Hex(std::as_bytes(std::span(material.base_color.data(), 3)));
    text += Sha256OfPicture(material.texture);
  }
  const double numbers[] = {double(options_.size), options_.picture.azimuth, options_.picture.elevation, options_.picture.in_plane_rotation};
  text += Sha256Hex(BytesOf(numbers));
  return Sha256Hex(BytesOf(text));
}

SynthesisCamera MeshSynthesizer::Camera() const {
  // The outline of the unit sphere at distance d has the radius f / sqrt(d^2 - 1).
  const double tangent = kTrainingFocalLength / (kSphereShare / 2);
  return {kTrainingFocalLength, std::sqrt(1 + tangent * tangent)};
}

cv::Mat MeshSynthesizer::Picture(const RelativeView& view) const {
  Viewpoint viewpoint = options_.picture;
  viewpoint.elevation -= view.polar;
  viewpoint.azimuth += view.azimuth;
  if (std::abs(viewpoint.elevation) > 90) {  // over a pole, upright on the other side
    viewpoint.elevation = std::copysign(180, viewpoint.elevation) - viewpoint.elevation;
    viewpoint.azimuth += 180;
  }
  viewpoint.distance = Camera().distance;
  const double focal_length = kTrainingFocalLength * options_.size;
  const PinholeCamera camera{options_.size, options_.size, focal_length, focal_length, options_.size / 2.0, options_.size / 2.0};
  return renderer_.Render(camera, CameraFromObject(viewpoint), options_.render).image;
}

void MeshSynthesizer::Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                                 const ProgressCallback& progress) const {
  for (std::size_t i = 0; i < requests.size(); ++i) {
    if (progress) progress({"rendering views", static_cast<std::int64_t>(i), static_cast<std::int64_t>(requests.size()), {}});
    use(PosedView(requests[i], Picture(requests[i].relative), Camera()));
  }
}

}  // namespace antipode
