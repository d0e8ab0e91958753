#include "antipode/util/suggest.h"

#include <gtest/gtest.h>

#include <random>

namespace antipode {
namespace {

const std::vector<std::string> kCommands = {"pose", "reference", "render", "evaluate", "doctor"};

TEST(NearestName, FindsMistypedNames) {
  EXPECT_EQ(NearestName("psoe", kCommands), "pose");
  EXPECT_EQ(NearestName("POSE", kCommands), "pose");
  EXPECT_EQ(NearestName("refrence", kCommands), "reference");
  EXPECT_EQ(NearestName("rendr", kCommands), "render");
  EXPECT_EQ(NearestName("evalaute", kCommands), "evaluate");
}

TEST(NearestName, SaysNothingWhenNothingIsNear) {
  EXPECT_EQ(NearestName("xylophone", kCommands), "");
  EXPECT_EQ(NearestName("", kCommands), "");
  EXPECT_EQ(NearestName("x", {"y", ""}), "");
  EXPECT_EQ(NearestName("pose", {}), "");
}

TEST(NearestName, OneEditIsAlwaysNear) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 500; ++trial) {
    const std::string& command = kCommands[random() % kCommands.size()];
    const std::size_t position = random() % command.size();
    std::string typed = command;
    switch (random() % 3) {
      case 0:
        typed.erase(position, 1);
        break;
      case 1:
        typed.insert(position, 1, 'q');
        break;
      default:
        typed[position] = 'q';
    }
    EXPECT_EQ(NearestName(typed, kCommands), command) << typed;
  }
}

}  // namespace
}  // namespace antipode
