#pragma once

#include <nlohmann/json.hpp>

#include "antipode/geometry/rigid3.h"

namespace antipode {

/// The 4 x 4 matrix, row by row.
nlohmann::ordered_json PoseToJson(const Rigid3& pose);

/// From its first three rows. @throws nlohmann::json::exception if it is none
Rigid3 PoseFromJson(const nlohmann::ordered_json& rows);

}  // namespace antipode
