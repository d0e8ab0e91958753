#include "antipode/nn/parts.h"

#include <gtest/gtest.h>

#include "antipode/nn/module_weights.h"

namespace antipode {
namespace {

TEST(RegisterAt, NamesParametersAsThePathSays) {
  torch::nn::Module root;
  RegisterAt(root, "block.0.conv", torch::nn::Linear(2, 3).ptr());
  RegisterAt(root, "block.1.conv", torch::nn::Linear(3, 1).ptr());
  RegisterAt(root, "head", torch::nn::Linear(torch::nn::LinearOptions(1, 1).bias(false)).ptr());
  std::vector<std::string> names;
  for (const auto& item : root.named_parameters()) names.push_back(item.key());
  std::ranges::sort(names);
  EXPECT_EQ(names,
            (std::vector<std::string>{"block.0.conv.bias", "block.0.conv.weight",
                                      "block.1.conv.bias", "block.1.conv.weight", "head.weight"}));
}

TEST(Prefixes, PartsOfAFileComeBackAsTheyWere) {
  TensorFile part, file;
  part.tensors["x.weight"] = HostTensor::FromFloat({2}, std::vector<float>{1, 2});
  file.tensors["other"] = HostTensor::FromFloat({1}, std::vector<float>{3});
  AddWithPrefix(file, part, "a.");
  EXPECT_EQ(file.tensors.size(), 2u);
  const TensorFile back = WithoutPrefix(file, "a.");
  ASSERT_EQ(back.tensors.size(), 1u);
  EXPECT_EQ(back.tensors.at("x.weight").ToDouble(), (std::vector<double>{1, 2}));
}

}  // namespace
}  // namespace antipode
