#include "antipode/util/seeds.h"

#include <set>

#include <gtest/gtest.h>

namespace antipode {
namespace {

TEST(DrawDistinct, DrawsEveryNumberAtMostOnce) {
  std::mt19937_64 random(1);
  const std::vector<int> some = DrawDistinct(5, 9, random);
  EXPECT_EQ(some.size(), 5u);
  EXPECT_EQ(std::set(some.begin(), some.end()).size(), 5u);
  for (const int number : some) EXPECT_TRUE(number >= 0 && number < 9);
  const std::vector<std::size_t> all = DrawDistinct<std::size_t>(10, 4, random);
  EXPECT_EQ(std::set(all.begin(), all.end()), (std::set<std::size_t>{0, 1, 2, 3}));
}

TEST(DrawDistinct, DrawsEveryNumberAsOften) {
  std::mt19937_64 random(2);
  constexpr int kDraws = 4000;
  std::vector<int> drawn(4);
  for (int i = 0; i < kDraws; ++i)
    for (const int number : DrawDistinct(2, 4, random)) ++drawn[static_cast<std::size_t>(number)];
  for (const int count : drawn) EXPECT_NEAR(count, kDraws / 2, 150);
}

}  // namespace
}  // namespace antipode
