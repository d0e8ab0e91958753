#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace antipode {

/// A binary glTF file with one tetrahedron, so that every view tells where the camera is.
inline std::string TetrahedronGlb(float height) {
  const std::vector<float> positions{0, height, 0, -0.6f, -0.4f, 0.5f, 0.7f, -0.4f, 0.3f, 0, -0.3f, -0.7f};
  const std::vector<float> colors{1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 0};
  const std::vector<std::uint32_t> indices{0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2};
  std::string buffer;
  const auto append = [&](const auto& values) {
    buffer.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  append(positions);
  append(colors);
  append(indices);
  const nlohmann::json view = {{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 48}};
  nlohmann::json color_view = view, index_view = view;
  color_view["byteOffset"] = 48;
  index_view["byteOffset"] = 96;
  const nlohmann::json description = {
      {"asset", {{"version", "2.0"}}},
      {"scene", 0},
      {"scenes", {{{"nodes", {0}}}}},
      {"nodes", {{{"mesh", 0}}}},
      {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}, {"COLOR_0", 1}}}, {"indices", 2}}}}}}},
      {"buffers", {{{"byteLength", buffer.size()}}}},
      {"bufferViews", {view, color_view, index_view}},
      {"accessors",
       {{{"bufferView", 0}, {"componentType", 5126}, {"count", 4}, {"type", "VEC3"},
         {"min", {-0.6, -0.4, -0.7}}, {"max", {0.7, height, 0.5}}},
        {{"bufferView", 1}, {"componentType", 5126}, {"count", 4}, {"type", "VEC3"}},
        {{"bufferView", 2}, {"componentType", 5125}, {"count", 12}, {"type", "SCALAR"}}}}};
  std::string json = description.dump();
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string file = "glTF";
  const auto word = [&](std::uint32_t value) { file.append(reinterpret_cast<const char*>(&value), 4); };
  word(2);
  word(static_cast<std::uint32_t>(12 + 8 + json.size() + 8 + buffer.size()));
  word(static_cast<std::uint32_t>(json.size()));
  file += "JSON" + json;
  word(static_cast<std::uint32_t>(buffer.size()));
  file += std::string("BIN\0", 4) + buffer;
  return file;
}

}  // namespace antipode
