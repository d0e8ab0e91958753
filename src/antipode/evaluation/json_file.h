#pragma once

#include <filesystem>

#include <nlohmann/json_fwd.hpp>

namespace antipode {

/// @throws BadFile naming the file if it cannot be read or is not JSON
nlohmann::json ReadJsonFile(const std::filesystem::path& path);

}  // namespace antipode
