// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

class Tensor;

// The steps of a layer that are not matrix products, on tensors: by the kernels of jet_kernels.h in main
// memory, by tensor operations on a device. `activations` and `jets` are (columns·n, width), `slope` is
// (n, width).

/// Softplus of this sharpness, and the number of columns: a value and its derivatives.
struct LayerStep {
  double sharpness = 30.0;
  int columns = 1;
};

/// Adds the bias and applies softplus. An undefined `slope` is not kept; one column does not use `jets`.
void activate_layer(const LayerStep& step, Tensor& activations, Tensor& slope, Tensor& jets,
                    const Tensor& bias);
/// The cotangents of activate_layer's inputs. A defined `partial` is added to them.
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
