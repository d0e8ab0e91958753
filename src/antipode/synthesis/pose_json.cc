#include "antipode/synthesis/pose_json.h"

namespace antipode {

nlohmann::ordered_json PoseToJson(const Rigid3& pose) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int r = 0; r < 3; ++r)
    rows.push_back({pose.rotation(r, 0), pose.rotation(r, 1), pose.rotation(r, 2), pose.translation[r]});
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  return rows;
}

Rigid3 PoseFromJson(const nlohmann::ordered_json& rows) {
  Rigid3 pose;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) pose.rotation(r, c) = rows.at(r).at(c);
    pose.translation[r] = rows.at(r).at(3);
  }
  return pose;
}

}  // namespace antipode
