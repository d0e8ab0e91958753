#pragma once

#include <cstdint>

namespace antipode {

/// Sizes of a depthwise convolution on channels-last data; channels are a multiple of 16.
struct DepthwiseShape {
  int batch, channels;
  int input_height, input_width;
  int output_height, output_width;
  int kernel, stride, padding;
};

/// Bit pattern of a bfloat16 number: the upper half of a float32.
struct BFloat16Bits {
  std::uint16_t bits;
};

/// Gradient with respect to the input, [N, H, W, C], of a gradient of the output, [N, Ho, Wo, C].
/// @param weight [K * K, C]
/// @param first_image, last_image the images to handle, so that callers can split the batch over threads
template <typename T>
void DepthwiseInputGradient(const DepthwiseShape& shape, const T* output_gradient,
                            const float* weight, T* input_gradient, int first_image,
                            int last_image);

/// Adds the gradient with respect to the weight, [K * K, C], and the bias, [C], of the images
/// first_image..last_image - 1.
template <typename T>
void AddDepthwiseWeightGradient(const DepthwiseShape& shape, const T* input,
                                const T* output_gradient, float* weight_gradient,
                                float* bias_gradient, int first_image, int last_image);

}  // namespace antipode
