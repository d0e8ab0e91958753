#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "antipode/render/mesh.h"

namespace antipode {

/// Says that a material has no texture.
inline constexpr std::uint32_t kNoTexture = 0xffffffff;

/// A mesh in few bytes that deflate well, textures apart. Kept exactly: triangles, which material each has, base colours,
/// the order of all. Rounded to whole steps s, so off by at most s / 2 an axis (and by the rounding of floats):
///   positions            s = longest side of the box of all vertices / 65535
///   texture coordinates  s = range / 65535, each axis its own
///   normals              octahedral, s = 1 / 511: within a quarter of a degree
///   vertex colours       sRGB-encoded, s = 1 / 255 of the brightest component or of 1, whichever is more
///
/// Layout, little-endian: u32 vertices, triangles, materials, flags (1 texture coordinates, 2 colours); a material: f32 base
/// colour [3], u32 texture; positions: f32 lowest [3], f32 step; columns u16 x, y, z; normals: columns u16 [2]; texture
/// coordinates: f32 lowest [2], f32 step [2]; columns u16 [2]; colours: f32 brightest, columns u8 [3]; vertices of the
/// triangles: a column u16 if there are at most 65536 vertices, else u32; materials of the triangles: a column u16.
/// A column holds differences d of neighbouring numbers, modulo 2^bits, as 2 d for d >= 0 and -2 d - 1 for d < 0; first
/// all lowest bytes, then all next ones. For vertices of triangles d = the number - 1 - the greatest so far.
///
/// @param textures one a material: the number of its texture, or kNoTexture
/// @throws Error if the mesh is not sound (Mesh::Check)
std::vector<std::byte> EncodeMesh(const Mesh& mesh, std::span<const std::uint32_t> textures);

/// @param texture gives the texture of a number; is called once for every material that has one
/// @throws Error if the bytes are not those of a sound mesh; whatever `texture` throws
Mesh DecodeMesh(std::span<const std::byte> bytes, const std::function<cv::Mat(std::uint32_t)>& texture);

}  // namespace antipode
