#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <zip.h>

/// The pieces of pickles, as torch.save writes them, for tests.
namespace antipode::test_pickles {

using Shape = std::vector<std::int64_t>;

inline std::string LittleEndian(std::uint64_t value, std::size_t bytes) {
  std::string text(bytes, '\0');
  std::memcpy(text.data(), &value, bytes);
  return text;
}

inline std::string Text(const std::string& text) {
  return std::string("X").append(LittleEndian(text.size(), 4)).append(text);
}

inline std::string Integer(std::int64_t value) {
  return std::string("\x8a\x08") + LittleEndian(static_cast<std::uint64_t>(value), 8);
}

inline std::string Tuple(const std::vector<std::string>& items) {
  std::string text = "(";
  for (const std::string& item : items) text += item;
  return text + "t";
}

inline std::string Tuple(const Shape& numbers) {
  std::vector<std::string> items;
  for (const std::int64_t number : numbers) items.push_back(Integer(number));
  return Tuple(items);
}

inline std::string Global(const std::string& module, const std::string& name) {
  return "c" + module + "\n" + name + "\n";
}

inline std::string Call(const std::string& callable, const std::string& arguments) {
  return callable + arguments + "R";
}

inline std::string Storage(const std::string& key, std::int64_t elements,
                    const std::string& type = "FloatStorage") {
  return Tuple(std::vector<std::string>{Text("storage"), Global("torch", type), Text(key),
                                        Text("cpu"), Integer(elements)}) +
         "Q";
}

inline std::string View(const std::string& storage, std::int64_t offset, const Shape& shape,
                 const Shape& stride) {
  const std::string hooks = Call(Global("collections", "OrderedDict"), ")");
  return Call(Global("torch._utils", "_rebuild_tensor_v2"),
              Tuple(std::vector<std::string>{storage, Integer(offset), Tuple(shape), Tuple(stride),
                                             "\x89", hooks}));
}

inline std::string Dict(const std::map<std::string, std::string>& values) {
  std::string text = "}(";
  for (const auto& [key, value] : values) text += Text(key) + value;
  return text + "u";
}

inline std::string WholePickle(const std::string& body) { return "\x80\x02" + body + "."; }

inline std::string Floats(const std::vector<float>& values) {
  std::string bytes(values.size() * sizeof(float), '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

inline void WriteZip(const std::filesystem::path& path, const std::map<std::string, std::string>& files) {
  std::filesystem::remove(path);
  zip_t* const archive = zip_open(path.c_str(), ZIP_CREATE, nullptr);
  ASSERT_NE(archive, nullptr);
  for (const auto& [name, content] : files) {
    zip_source_t* const source = zip_source_buffer(archive, content.data(), content.size(), 0);
    ASSERT_GE(zip_file_add(archive, name.c_str(), source, 0), 0);
  }
  ASSERT_EQ(zip_close(archive), 0);
}

}  // namespace antipode::test_pickles
