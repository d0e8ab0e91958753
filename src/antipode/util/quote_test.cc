#include "antipode/util/quote.h"

#include <gtest/gtest.h>

#include <cstdio>

#include "antipode/util/version.h"

namespace antipode {
namespace {

TEST(Quoted, KeepsPlainTextAndHidesTheRest) {
  EXPECT_EQ(Quoted("layer.0"), "'layer.0'");
  EXPECT_EQ(Quoted("a\nb\x1b[31m\xff"), "'a?b?[31m?'");
  EXPECT_EQ(Quoted(std::string(121, 'x')), "'" + std::string(120, 'x') + "...'");
}

TEST(Version, HasThreeNumbers) {
  int major = -1, minor = -1, patch = -1;
  EXPECT_EQ(std::sscanf(Version(), "%d.%d.%d", &major, &minor, &patch), 3);
}

}  // namespace
}  // namespace antipode
