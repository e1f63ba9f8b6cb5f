// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace at {
class Tensor;
}

namespace arapfields {

/// The layer steps that are not matrix products, on tensors: kernels (jet_kernels.h) for those in main
/// memory, compositions of libtorch's operations elsewhere. `activations` and `jets` are (columns·n, width);
/// slope (n, width).
struct LayerStep {
  double sharpness = 30.0;
  int columns = 1;
};

/// `slope` may be undefined: then nothing is kept. `jets` is not used with one column.
void activate_layer(const LayerStep& step, at::Tensor& activations, at::Tensor& slope, at::Tensor& jets,
                    const at::Tensor& bias);
/// `partial` may be undefined; otherwise it is added to the result.
void activate_layer_back(const LayerStep& step, at::Tensor& activations, const at::Tensor& slope,
                         const at::Tensor& partial, at::Tensor& cotangents, at::Tensor& bias_gradient);
/// One layer's part in the second derivatives (adjoint_kernels.h). `adjoints` (outputs·n, width), or
/// (outputs, width) for all points; `below` (outputs·n, width); `second` (n, 6, outputs) is added to.
void adjoint_layer(double sharpness, const at::Tensor& activations, const at::Tensor& slope,
                   const at::Tensor& adjoints, at::Tensor& below, at::Tensor& second);
void adjoint_layer_back(double sharpness, const at::Tensor& activations, const at::Tensor& slope,
                        const at::Tensor& adjoints, const at::Tensor& second, at::Tensor& cotangents,
                        at::Tensor& below, at::Tensor& partial);
/// encoding (1 to 3, n, 6·octaves): values, and the first and second derivative of each entry.
void encode_points(const at::Tensor& points, double frequency, int octaves, at::Tensor& encoding);

}  // namespace arapfields
