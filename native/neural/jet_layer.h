// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

class Tensor;

/// The layer steps that are not matrix products, on tensors: kernels (jet_kernels.h) for those in main
/// memory, compositions of tensor operations elsewhere. `activations` and `jets` are (columns·n, width);
/// slope (n, width).
struct LayerStep {
  double sharpness = 30.0;
  int columns = 1;
};

/// `slope` may be undefined: then nothing is kept. `jets` is not used with one column.
void activate_layer(const LayerStep& step, Tensor& activations, Tensor& slope, Tensor& jets,
                    const Tensor& bias);
/// `partial` may be undefined; otherwise it is added to the result.
void activate_layer_back(const LayerStep& step, Tensor& activations, const Tensor& slope,
                         const Tensor& partial, Tensor& cotangents, Tensor& bias_gradient);
/// One layer's part in the second derivatives (adjoint_kernels.h). `adjoints` (outputs·n, width), or
/// (outputs, width) for all points; `below` (outputs·n, width); `second` (n, 6, outputs) is added to.
void adjoint_layer(double sharpness, const Tensor& activations, const Tensor& slope, const Tensor& adjoints,
                   Tensor& below, Tensor& second);
void adjoint_layer_back(double sharpness, const Tensor& activations, const Tensor& slope,
                        const Tensor& adjoints, const Tensor& second, Tensor& cotangents, Tensor& below,
                        Tensor& partial);
/// encoding (1 to 3, n, 6·octaves): values, and the first and second derivative of each entry.
void encode_points(const Tensor& points, double frequency, int octaves, Tensor& encoding);

}  // namespace arapfields
