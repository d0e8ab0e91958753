#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "antipode/render/mesh.h"

namespace antipode {

/// Writes one mesh as binary glTF: a primitive a material, which all share the vertices.
class GlbWriter {
 public:
  explicit GlbWriter(const Mesh& mesh) : mesh_(mesh) {
    AddVertices();
    for (std::size_t i = 0; i < mesh.materials.size(); ++i) AddMaterial(i);
  }

  std::string Write() {
    gltf_["asset"]["version"] = "2.0";
    gltf_["scene"] = 0;
    gltf_["scenes"] = {{{"nodes", {0}}}};
    gltf_["nodes"] = {{{"mesh", 0}}};
    gltf_["buffers"] = {{{"byteLength", buffer_.size()}}};
    std::string json = gltf_.dump();
    json.resize((json.size() + 3) / 4 * 4, ' ');
    return "glTF" + Word(2) + Word(12 + 8 + json.size() + 8 + buffer_.size()) + Word(json.size()) + "JSON" + json +
           Word(buffer_.size()) + std::string("BIN\0", 4) + buffer_;
  }

 private:
  static std::string Word(std::size_t value) {
    const auto word = static_cast<std::uint32_t>(value);
    return {reinterpret_cast<const char*>(&word), sizeof word};
  }

  std::size_t AddView(const void* data, std::size_t bytes) {
    gltf_["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", bytes}});
    buffer_.append(static_cast<const char*>(data), bytes);
    buffer_.resize((buffer_.size() + 3) / 4 * 4, '\0');
    return gltf_["bufferViews"].size() - 1;
  }

  template <typename Value>
  std::size_t AddAccessor(const std::vector<Value>& values, int component_type, std::size_t count, const char* type) {
    const std::size_t view = AddView(values.data(), values.size() * sizeof(Value));
    gltf_["accessors"].push_back({{"bufferView", view}, {"componentType", component_type}, {"count", count}, {"type", type}});
    return gltf_["accessors"].size() - 1;
  }

  void AddVertices() {
    constexpr int kFloat = 5126;
    const std::size_t count = mesh_.positions.size();
    attributes_["POSITION"] = AddAccessor(mesh_.positions, kFloat, count, "VEC3");
    attributes_["NORMAL"] = AddAccessor(mesh_.normals, kFloat, count, "VEC3");
    if (!mesh_.texcoords.empty()) attributes_["TEXCOORD_0"] = AddAccessor(mesh_.texcoords, kFloat, count, "VEC2");
    if (!mesh_.colors.empty()) attributes_["COLOR_0"] = AddAccessor(mesh_.colors, kFloat, count, "VEC3");
  }

  void AddMaterial(std::size_t index) {
    constexpr int kUnsignedInt = 5125;
    std::vector<std::uint32_t> corners;
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
      const auto& triangle = mesh_.triangles[i];
      if (mesh_.triangle_materials[i] == index) corners.insert(corners.end(), triangle.begin(), triangle.end());
    }
    const std::size_t indices = AddAccessor(corners, kUnsignedInt, corners.size(), "SCALAR");
    gltf_["meshes"][0]["primitives"].push_back({{"attributes", attributes_}, {"indices", indices}, {"material", index}});
    const Eigen::Vector3f& color = mesh_.materials[index].base_color;
    nlohmann::json appearance = {{"baseColorFactor", {color.x(), color.y(), color.z(), 1}}};
    if (!mesh_.materials[index].texture.empty()) appearance["baseColorTexture"]["index"] = AddTexture(mesh_.materials[index].texture);
    gltf_["materials"].push_back({{"pbrMetallicRoughness", appearance}});
  }

  std::size_t AddTexture(const cv::Mat& rgb) {
    cv::Mat bgr;
    cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
    std::vector<std::uint8_t> png;
    cv::imencode(".png", bgr, png);
    const std::size_t view = AddView(png.data(), png.size());
    gltf_["images"].push_back({{"bufferView", view}, {"mimeType", "image/png"}});
    gltf_["textures"].push_back({{"source", gltf_["images"].size() - 1}});
    return gltf_["textures"].size() - 1;
  }

  const Mesh& mesh_;
  nlohmann::json gltf_, attributes_;
  std::string buffer_;
};

inline std::string GlbOf(const Mesh& mesh) { return GlbWriter(mesh).Write(); }

}  // namespace antipode
