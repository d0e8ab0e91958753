#include <cstdio>

#include <antipode/prior/correlation.h>

/// Correlates two codes of degree 1 whose coefficients are all one: 1 + 3 x 3 entries of one.
int main() {
  const torch::Tensor code = torch::ones({1, 1, 4});
  const torch::Tensor correlation = antipode::CorrelateCodes(code, code, 1);
  std::printf("correlation of %lld entries, sum %.1f\n",
              static_cast<long long>(correlation.numel()), correlation.sum().item<double>());
  return correlation.numel() == 10 && correlation.sum().item<double>() == 10 ? 0 : 1;
}
