#include "torch_tensors.h"

#include <cmath>
#include <regex>
#include <sstream>

#include "antipode/nn/synthetic_weights.h"
#include "antipode/util/error.h"

namespace antipode::golden {

NumericTensor FromTorchTensor(const torch::Tensor& tensor) {
  const auto values = tensor.to(torch::kDouble).contiguous();
  NumericTensor result(tensor.sizes().vec());
  result.values.assign(values.const_data_ptr<double>(), values.const_data_ptr<double>() + values.numel());
  return result;
}

namespace {

/// Twenty-four sinusoids per plane, through the logistic function.
torch::Tensor SmoothPictures(const std::string& name, const std::vector<std::int64_t>& shape) {
  constexpr std::int64_t kWaves = 24;
  const std::int64_t height = shape[shape.size() - 2], width = shape.back();
  std::int64_t planes = 1;
  for (std::size_t i = 0; i + 2 < shape.size(); ++i) planes *= shape[i];
  const auto waves = SyntheticUniform(name, {planes, kWaves, 4}).unsqueeze(3).unsqueeze(4);  // [P, 24, 4, 1, 1]
  const auto x = torch::arange(width, torch::kDouble).view({1, 1, width}), y = torch::arange(height, torch::kDouble).view({1, height, 1});
  torch::Tensor sum = torch::zeros({planes, height, width}, torch::kDouble);
  for (std::int64_t k = 0; k < kWaves; ++k) {
    const auto wave = waves.select(1, k);
    const auto cycles = wave.select(1, 0) * 8 * x / 96 + wave.select(1, 1) * 8 * y / 96 + wave.select(1, 2);
    sum += wave.select(1, 3) * at::sin(2 * M_PI * cycles);
  }
  return at::sigmoid(sum).view(shape).to(torch::kFloat);
}

/// The entry whose name ends in ".key", of a list of inputs.
torch::Tensor ListedInput(const GoldenCase& golden_case, const std::string& key) {
  for (const nlohmann::json& input : golden_case.generated_inputs) {
    const std::string name = input.at("name"), range = input.at("range");
    if (!name.ends_with("." + key)) continue;
    const auto shape = input.at("shape").get<std::vector<std::int64_t>>();
    if (range == "smooth") return SmoothPictures(name, shape);
    const torch::Tensor values = SyntheticUniform(name, shape);
    if (range == "01") return ((values + 1) / 2).to(torch::kFloat);
    if (range == "sqrt3") return (values * std::sqrt(3.0)).to(torch::kFloat);
    throw Error(name, "is of an unknown range '" + range + "'");
  }
  throw Error(golden_case.name, "generates no input '" + key + "'");
}

}  // namespace

torch::Tensor StoredTensor(const GoldenCase& golden_case, const std::string& name) {
  const NumericTensor& stored = golden_case.Stored(name);
  return torch::tensor(stored.values, torch::kDouble).view(stored.shape);
}

torch::Tensor GeneratedTensor(const GoldenCase& golden_case, const std::string& key, int step) {
  if (golden_case.generated_inputs.is_array()) return ListedInput(golden_case, key);
  if (!golden_case.generated_inputs.contains(key)) throw Error(golden_case.name, "generates no input '" + key + "'");
  const nlohmann::json& input = golden_case.generated_inputs.at(key);
  const std::string name = std::regex_replace(input.at("name").get<std::string>(), std::regex("\\{k\\}"), std::to_string(step));
  const std::string kind = input.at("kind");
  torch::Tensor values = SyntheticUniform(name, input.at("shape").get<std::vector<std::int64_t>>());
  if (kind.starts_with("unit")) {
    values = values * std::sqrt(3.0);
  } else if (!kind.starts_with("plain")) {
    throw Error(name, "is of an unknown kind '" + kind + "'");
  }
  values = values.to(torch::kFloat);
  std::smatch factor;
  if (std::regex_search(kind, factor, std::regex("multiplied by ([0-9.e+-]+)"))) values = values * std::stof(factor[1]);
  return values;
}

torch::Tensor Sliced(torch::Tensor tensor, const std::string& slices) {
  const std::string inside = slices.substr(1, slices.find(']') - 1);
  std::istringstream axes(inside);
  std::int64_t axis = 0;
  for (std::string text; std::getline(axes, text, ','); ++axis) {
    std::istringstream parts(text);
    std::vector<std::int64_t> numbers;  // start, end, step
    const std::int64_t defaults[] = {0, tensor.size(axis), 1};
    for (std::string part; std::getline(parts, part, ':');)
      numbers.push_back(part.empty() ? defaults[numbers.size()] : std::stoll(part));
    while (numbers.size() < 3) numbers.push_back(defaults[numbers.size()]);
    tensor = tensor.slice(axis, numbers[0], numbers[1], numbers[2]);
  }
  return tensor;
}

Observation Recorder::Look() {
  return Observation([this](const std::string& name, const torch::Tensor& tensor) { Add(name, tensor); });
}

void Recorder::Add(const std::string& name, const torch::Tensor& tensor) {
  for (const TensorSpec& spec : case_.specs) {
    if (spec.name != name) continue;
    const std::string slices = spec.attributes.value("stored_slice_of_full_tensor", "");
    recorded_[name] = FromTorchTensor(slices.empty() ? tensor : Sliced(tensor, slices));
  }
}

}  // namespace antipode::golden
