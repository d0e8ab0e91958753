#include "antipode/nn/depthwise_conv.h"

#include <vector>

#include <ATen/Parallel.h>

#include "antipode/nn/depthwise_gradient.h"

namespace antipode {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

struct Gradients {
  Tensor input, weight, bias;
};

template <typename Scalar, typename Stored>
Gradients ComputeGradients(const Tensor& input, const Tensor& weight, const Tensor& output_gradient,
                           int stride, int padding) {
  const int kernel = static_cast<int>(weight.size(2)), channels = static_cast<int>(input.size(1));
  const DepthwiseShape shape{static_cast<int>(input.size(0)), channels,
                             static_cast<int>(input.size(2)), static_cast<int>(input.size(3)),
                             static_cast<int>(output_gradient.size(2)),
                             static_cast<int>(output_gradient.size(3)), kernel, stride, padding};
  const Tensor taps = weight.detach().to(torch::kFloat).view({channels, kernel * kernel}).t().contiguous();
  Tensor input_gradient = torch::empty_like(input);
  Tensor tap_gradient = torch::zeros({kernel * kernel, channels}, torch::kFloat);
  Tensor bias_gradient = torch::zeros({channels}, torch::kFloat);

  const auto* x = reinterpret_cast<const Stored*>(input.const_data_ptr<Scalar>());
  const auto* g = reinterpret_cast<const Stored*>(output_gradient.const_data_ptr<Scalar>());
  auto* dx = reinterpret_cast<Stored*>(input_gradient.data_ptr<Scalar>());
  // One part for each thread's share, at its first image; summed in order, so that rounding does not depend on who is faster.
  struct Part {
    std::vector<float> weight, bias;
  };
  std::vector<Part> parts(shape.batch);
  at::parallel_for(0, shape.batch, 1, [&](std::int64_t begin, std::int64_t end) {
    const int first = static_cast<int>(begin), last = static_cast<int>(end);
    DepthwiseInputGradient(shape, g, taps.const_data_ptr<float>(), dx, first, last);
    Part& part = parts[begin] = {std::vector<float>(kernel * kernel * channels), std::vector<float>(channels)};
    AddDepthwiseWeightGradient(shape, x, g, part.weight.data(), part.bias.data(), first, last);
  });
  const auto add = [](const std::vector<float>& part, float* sum) {
    for (const float value : part) *sum++ += value;
  };
  for (const Part& part : parts) {
    add(part.weight, tap_gradient.data_ptr<float>());
    add(part.bias, bias_gradient.data_ptr<float>());
  }
  return {input_gradient, tap_gradient.t().reshape_as(weight).to(weight.dtype()),
          bias_gradient.to(weight.dtype())};
}

bool OwnKernelsApply(const Tensor& input, const Tensor& weight) {
  const auto kernel = weight.size(2);
  const auto dtype = input.scalar_type();
  return input.device().is_cpu() && input.size(1) % 16 == 0 && (kernel == 3 || kernel == 5) &&
         (dtype == torch::kFloat || dtype == torch::kBFloat16) &&
         input.is_contiguous(torch::MemoryFormat::ChannelsLast);
}

class DepthwiseFunction : public torch::autograd::Function<DepthwiseFunction> {
 public:
  static Tensor forward(AutogradContext* context, const Tensor& input, const Tensor& weight,
                        const Tensor& bias, std::int64_t stride, std::int64_t padding) {
    context->save_for_backward({input, weight});
    context->saved_data["stride"] = stride;
    context->saved_data["padding"] = padding;
    return at::conv2d(input, weight, bias, stride, padding, 1, input.size(1));
  }

  static variable_list backward(AutogradContext* context, variable_list output_gradients) {
    const auto saved = context->get_saved_variables();
    const Tensor &input = saved[0], &weight = saved[1];
    const int stride = static_cast<int>(context->saved_data["stride"].toInt());
    const int padding = static_cast<int>(context->saved_data["padding"].toInt());
    const Tensor gradient =
        output_gradients[0].to(input.dtype()).contiguous(torch::MemoryFormat::ChannelsLast);
    const Gradients result =
        input.scalar_type() == torch::kBFloat16
            ? ComputeGradients<at::BFloat16, BFloat16Bits>(input, weight, gradient, stride, padding)
            : ComputeGradients<float, float>(input, weight, gradient, stride, padding);
    return {result.input, result.weight, result.bias, Tensor(), Tensor()};
  }
};

}  // namespace

Tensor DepthwiseConv2d(const Tensor& input, const Tensor& weight, const Tensor& bias, int stride,
                       int padding) {
  const bool needs_gradient = torch::GradMode::is_enabled() &&
                              (input.requires_grad() || weight.requires_grad());
  if (!needs_gradient || !OwnKernelsApply(input, weight))
    return at::conv2d(input, weight, bias, stride, padding, 1, input.size(1));
  return DepthwiseFunction::apply(input, weight.to(input.dtype()), bias.to(input.dtype()), stride, padding);
}

}  // namespace antipode
