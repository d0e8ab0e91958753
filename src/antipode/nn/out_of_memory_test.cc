#include "antipode/nn/out_of_memory.h"

#include <new>

#include <gtest/gtest.h>
#include <torch/torch.h>

namespace antipode {
namespace {

template <typename Action>
bool RunsOutOfMemory(Action action) {
  try {
    action();
  } catch (const std::exception& error) {
    return IsOutOfMemory(error);
  }
  return false;
}

TEST(OutOfMemory, IsWhatAllocatorsSay) {
  EXPECT_TRUE(RunsOutOfMemory([] { return torch::empty({std::int64_t{1} << 55}); }));
  EXPECT_TRUE(RunsOutOfMemory([] { throw std::bad_alloc(); }));
}

TEST(OutOfMemory, IsNoOtherError) {
  EXPECT_FALSE(RunsOutOfMemory([] { return torch::ones({2, 3}).matmul(torch::ones({2, 3})); }));
  EXPECT_FALSE(RunsOutOfMemory([] { throw std::runtime_error("CPUAllocator"); }));
}

}  // namespace
}  // namespace antipode
