#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include <Eigen/Core>

#include "antipode/render/mesh.h"

namespace antipode {

inline constexpr int kPacketSize = 16;
inline constexpr std::uint32_t kNoTriangle = 0xffffffffu;

/// Directions of rays from one origin; rays with `active` 0 are not cast, those with -1 are.
struct RayPacket {
  alignas(64) std::array<std::int32_t, kPacketSize> active{};
  alignas(64) std::array<float, kPacketSize> x{};
  alignas(64) std::array<float, kPacketSize> y{};
  alignas(64) std::array<float, kPacketSize> z{};
};

/// The nearest hit of each ray: origin + distance * direction = (1 - u - v) p0 + u p1 + v p2.
struct HitPacket {
  std::array<std::uint32_t, kPacketSize> triangle;  ///< kNoTriangle where nothing is hit
  std::array<float, kPacketSize> distance;          ///< in lengths of the direction
  std::array<float, kPacketSize> u;
  std::array<float, kPacketSize> v;
};

/// Finds where rays meet the triangles of a mesh. Thread safe.
class RayCaster {
 public:
  explicit RayCaster(const Mesh& mesh);
  ~RayCaster();

  HitPacket NearestHits(const Eigen::Vector3f& origin, const RayPacket& rays) const;

  /// 1 for each ray that hits something, 0 for the others.
  std::array<bool, kPacketSize> AnyHits(const Eigen::Vector3f& origin, const RayPacket& rays) const;

 private:
  struct Embree;
  std::unique_ptr<Embree> embree_;
};

}  // namespace antipode
