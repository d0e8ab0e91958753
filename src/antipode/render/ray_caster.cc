#include "antipode/render/ray_caster.h"

#include <algorithm>
#include <limits>
#include <string>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "antipode/util/error.h"

namespace antipode {
namespace {

struct Release {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
  void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
template <typename Handle>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

void RequireNoError(RTCDevice device) {
  const RTCError error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_NONE) return;
  throw Error("ray casting", "Embree failed with error " + std::to_string(error));
}

template <typename Element>
void FillBuffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format,
                const std::vector<Element>& elements) {
  void* buffer =
      rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(Element), elements.size());
  if (!buffer) throw Error("ray casting", "not enough memory for the mesh");
  std::copy(elements.begin(), elements.end(), static_cast<Element*>(buffer));
}

void SetRays(const Eigen::Vector3f& origin, const RayPacket& rays, RTCRay16& out) {
  for (int i = 0; i < kPacketSize; ++i) {
    out.org_x[i] = origin.x();
    out.org_y[i] = origin.y();
    out.org_z[i] = origin.z();
    out.tnear[i] = 0;
    out.dir_x[i] = rays.x[i];
    out.dir_y[i] = rays.y[i];
    out.dir_z[i] = rays.z[i];
    out.time[i] = 0;
    out.tfar[i] = std::numeric_limits<float>::infinity();
    out.mask[i] = ~0u;
    out.id[i] = 0;
    out.flags[i] = 0;
  }
}

void Intersect(const RayPacket& rays, RTCScene scene, RTCRayHit16& hits) {
#if RTC_VERSION_MAJOR >= 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  rtcIntersect16(rays.active.data(), scene, &hits, &arguments);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect16(rays.active.data(), scene, &context, &hits);
#endif
}

void Occluded(const RayPacket& packet, RTCScene scene, RTCRay16& rays) {
#if RTC_VERSION_MAJOR >= 4
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  rtcOccluded16(packet.active.data(), scene, &rays, &arguments);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcOccluded16(packet.active.data(), scene, &context, &rays);
#endif
}

}  // namespace

struct RayCaster::Embree {
  Owned<RTCDevice> device;
  Owned<RTCScene> scene;
};

RayCaster::RayCaster(const Mesh& mesh) : embree_(std::make_unique<Embree>()) {
  embree_->device.reset(rtcNewDevice(nullptr));
  if (!embree_->device) throw Error("ray casting", "Embree does not start on this machine");
  const RTCDevice device = embree_->device.get();
  const Owned<RTCGeometry> geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  FillBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh.positions);
  FillBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh.triangles);
  rtcCommitGeometry(geometry.get());
  embree_->scene.reset(rtcNewScene(device));
  // Without it rays slip between neighbouring triangles.
  rtcSetSceneFlags(embree_->scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcAttachGeometry(embree_->scene.get(), geometry.get());
  rtcCommitScene(embree_->scene.get());
  RequireNoError(device);
}

RayCaster::~RayCaster() = default;

HitPacket RayCaster::NearestHits(const Eigen::Vector3f& origin, const RayPacket& rays) const {
  RTCRayHit16 query;
  SetRays(origin, rays, query.ray);
  std::fill_n(query.hit.geomID, kPacketSize, RTC_INVALID_GEOMETRY_ID);
  Intersect(rays, embree_->scene.get(), query);
  HitPacket hits;
  for (int i = 0; i < kPacketSize; ++i) {
    const bool hit = query.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    hits.triangle[i] = hit ? query.hit.primID[i] : kNoTriangle;
    hits.distance[i] = query.ray.tfar[i];
    hits.u[i] = query.hit.u[i];
    hits.v[i] = query.hit.v[i];
  }
  return hits;
}

std::array<bool, kPacketSize> RayCaster::AnyHits(const Eigen::Vector3f& origin,
                                                 const RayPacket& rays) const {
  RTCRay16 query;
  SetRays(origin, rays, query);
  Occluded(rays, embree_->scene.get(), query);
  std::array<bool, kPacketSize> hits;
  for (int i = 0; i < kPacketSize; ++i) hits[i] = rays.active[i] != 0 && query.tfar[i] < 0;
  return hits;
}

}  // namespace antipode
