#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "antipode/render/mesh.h"

namespace antipode {

/// A finely cut sphere about the origin with smooth normals.
inline Mesh MakeSphere(float radius, int rings = 64) {
  Mesh mesh;
  mesh.materials.emplace_back();
  const int columns = 2 * rings;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j <= columns; ++j) {
      const float polar = std::numbers::pi_v<float> * i / rings;
      const float azimuth = 2 * std::numbers::pi_v<float> * j / columns;
      const Eigen::Vector3f normal(std::sin(polar) * std::sin(azimuth), std::cos(polar),
                                   std::sin(polar) * std::cos(azimuth));
      mesh.positions.push_back(radius * normal);
      mesh.normals.push_back(normal);
    }
  }
  const std::uint32_t stride = columns + 1;
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(rings); ++i) {
    for (std::uint32_t j = 0; j + 1 < stride; ++j) {
      const std::uint32_t a = i * stride + j, b = a + stride;
      if (i > 0) mesh.triangles.emplace_back(a, b, a + 1);
      if (i + 1 < static_cast<std::uint32_t>(rings)) mesh.triangles.emplace_back(a + 1, b, b + 1);
    }
  }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

/// A parallelogram seen from the side from which `right` and `up` look so: texture upright on it.
inline void AddQuad(const Eigen::Vector3f& bottom_left, const Eigen::Vector3f& right,
                    const Eigen::Vector3f& up, std::uint16_t material, Mesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {bottom_left, bottom_left + right,
                                               bottom_left + right + up, bottom_left + up});
  mesh.normals.insert(mesh.normals.end(), 4, right.cross(up).normalized());
  mesh.texcoords.insert(mesh.texcoords.end(), {{0, 1}, {1, 1}, {1, 0}, {0, 0}});
  mesh.triangles.emplace_back(first, first + 1, first + 2);
  mesh.triangles.emplace_back(first, first + 2, first + 3);
  mesh.triangle_materials.insert(mesh.triangle_materials.end(), 2, material);
}

/// The box [-h, h] in each axis, flat normals, one material a face: +X -X +Y -Y +Z -Z.
inline Mesh MakeBox(const Eigen::Vector3f& h) {
  Mesh mesh;
  mesh.materials.resize(6);
  const float x = h.x(), y = h.y(), z = h.z();
  AddQuad({x, -y, z}, {0, 0, -2 * z}, {0, 2 * y, 0}, 0, mesh);
  AddQuad({-x, -y, -z}, {0, 0, 2 * z}, {0, 2 * y, 0}, 1, mesh);
  AddQuad({-x, y, z}, {2 * x, 0, 0}, {0, 0, -2 * z}, 2, mesh);
  AddQuad({-x, -y, -z}, {2 * x, 0, 0}, {0, 0, 2 * z}, 3, mesh);
  AddQuad({-x, -y, z}, {2 * x, 0, 0}, {0, 2 * y, 0}, 4, mesh);
  AddQuad({x, -y, -z}, {-2 * x, 0, 0}, {0, 2 * y, 0}, 5, mesh);
  return mesh;
}

inline const cv::Vec3b kRed(255, 0, 0), kGreen(0, 255, 0), kBlue(0, 0, 255), kYellow(255, 255, 0);

/// RGB: top left red, top right green, bottom left blue, bottom right yellow.
inline cv::Mat FourColors(int side) {
  cv::Mat texture(side, side, CV_8UC3);
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) {
      const bool top = i < side / 2, left = j < side / 2;
      texture.at<cv::Vec3b>(i, j) = top ? (left ? kRed : kGreen) : (left ? kBlue : kYellow);
    }
  }
  return texture;
}

}  // namespace antipode
