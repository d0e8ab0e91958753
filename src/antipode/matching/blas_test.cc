#include <dlfcn.h>

#include <string>

#include <gtest/gtest.h>
#include <torch/torch.h>

namespace antipode {
namespace {

// Ceres and OpenCV may bring a slow BLAS. Whichever library defines sgemm_ first serves the matrix products of torch too.
TEST(Blas, MatrixProductsAreThoseOfLibTorch) {
  if (!at::hasMKL()) GTEST_SKIP() << "this LibTorch has no BLAS of its own";
  void* const product = dlsym(RTLD_DEFAULT, "sgemm_");
  ASSERT_NE(product, nullptr);
  Dl_info library{};
  ASSERT_NE(dladdr(product, &library), 0);
  EXPECT_NE(std::string(library.dli_fname).find("libtorch"), std::string::npos) << library.dli_fname;
}

}  // namespace
}  // namespace antipode
