// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace at {
class Tensor;
}

namespace arapfields {

/// The layer steps that are not matrix products, on tensors: kernels (jet_kernels.h) for those in main
/// memory, compositions of libtorch's operations elsewhere. `planes` and `jets` are (columns·n, width); slope
/// (n, width).
struct LayerStep {
  double sharpness = 30.0;
  int columns = 1;
  bool mixed = true;  ///< as in ActivationBlock
};

/// `slope` may be undefined: then nothing is kept. `jets` is not used with one column.
void activate_layer(const LayerStep& step, at::Tensor& planes, at::Tensor& slope, at::Tensor& jets,
                    const at::Tensor& bias);
void activate_layer_back(const LayerStep& step, at::Tensor& planes, const at::Tensor& slope,
                         at::Tensor& cotangents, at::Tensor& bias_gradient);
/// encoding (1 to 3, n, 6·octaves): values, and the first and second derivative of each entry.
void encode_points(const at::Tensor& points, double frequency, int octaves, at::Tensor& encoding);

}  // namespace arapfields
