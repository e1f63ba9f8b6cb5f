// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/adjoint_kernels.h"
#include "neural/jet_layer.h"
#include "tensors/device_path.h"
#include "tensors/operations.h"

namespace arapfields {
namespace {

constexpr int first_of_pair[6] = {0, 1, 2, 0, 0, 1};
constexpr int second_of_pair[6] = {0, 1, 2, 1, 2, 2};

template <class Scalar>
AdjointBlock<Scalar> block_of(double sharpness, const Tensor& activations, const Tensor& slope,
                              const Tensor& adjoints, Tensor& below) {
  AdjointBlock<Scalar> block;
  block.activations = activations.data<Scalar>();
  block.slope = slope.data<Scalar>();
  block.adjoints = adjoints.data<Scalar>();
  block.shared = adjoints.size(0) != below.size(0);
  block.below = below.data<Scalar>();
  block.sharpness = static_cast<Scalar>(sharpness);
  block.points = slope.size(0);
  block.width = slope.size(1);
  block.outputs = static_cast<int>(below.size(0) / slope.size(0));
  return block;
}

template <class Scalar>
void adjoint_on_cpu(double sharpness, const Tensor& activations, const Tensor& slope, const Tensor& adjoints,
                    Tensor& below, Tensor& second) {
  const AdjointBlock<Scalar> block = block_of<Scalar>(sharpness, activations, slope, adjoints, below);
  ARAPFIELDS_DISPATCH(adjoint(block, second.data<Scalar>()));
}

template <class Scalar>
void adjoint_back_on_cpu(double sharpness, const Tensor& activations, const Tensor& slope,
                         const Tensor& adjoints, const Tensor& second, Tensor& cotangents, Tensor& below,
                         Tensor& partial) {
  const AdjointBlock<Scalar> block = block_of<Scalar>(sharpness, activations, slope, adjoints, below);
  ARAPFIELDS_DISPATCH(
      adjoint_back(block, second.data<Scalar>(), cotangents.data<Scalar>(), partial.data<Scalar>()));
}

/// (rows/points, points, width), one row a time for all points where there is but one.
Tensor by_output(const Tensor& rows, Index outputs) {
  return rows.view({outputs, rows.size(0) / outputs, rows.size(1)});
}

void adjoint_composed(double sharpness, const Tensor& activations, const Tensor& s, const Tensor& adjoints,
                      Tensor& below, Tensor& second) {
  const Index outputs = second.size(2);
  const Tensor z = activations.view({4, s.size(0), s.size(1)}).from(0, 1);
  const Tensor q = by_output(adjoints, outputs), curve = sharpness * s * (1 - s);
  by_output(below, outputs).assign(s * q);
  for (int c = 0; c < 6; ++c) {
    const Tensor bent = curve * z[first_of_pair[c]] * z[second_of_pair[c]];
    second.select(1, c) += sum(q * bent, {2}).t();
  }
}

void adjoint_back_composed(double sharpness, const Tensor& activations, const Tensor& s,
                           const Tensor& adjoints, const Tensor& second, Tensor& cotangents, Tensor& below,
                           Tensor& partial) {
  const Index outputs = second.size(2);
  const Tensor z = activations.view({4, s.size(0), s.size(1)}).from(0, 1);
  const Tensor q = by_output(adjoints, outputs), curve = sharpness * s * (1 - s);
  Tensor g = by_output(cotangents, outputs), part = partial.view({4, s.size(0), s.size(1)});
  Tensor bent = zeros_like(g);
  part.set_zero();
  for (int c = 0; c < 6; ++c) {
    const int i = first_of_pair[c], j = second_of_pair[c];
    const Tensor d = second.select(1, c).t().unsqueeze(-1);  // (outputs, n, 1)
    const Tensor weighted = sum(q * d, {0}) * curve;
    bent += d * (z[i] * z[j]);
    part[1 + i] += weighted * z[j];
    part[1 + j] += weighted * z[i];
  }
  part[0].assign(curve * sum(q * (g + sharpness * (1 - 2 * s) * bent), {0}));
  g.assign(s * g + curve * bent);
  by_output(below, outputs).assign(s * q);
}

}  // namespace

void adjoint_layer(double sharpness, const Tensor& activations, const Tensor& slope, const Tensor& adjoints,
                   Tensor& below, Tensor& second) {
  if (on_device_path(activations))
    return adjoint_composed(sharpness, activations, slope, adjoints, below, second);
  if (activations.is_double())
    return adjoint_on_cpu<double>(sharpness, activations, slope, adjoints, below, second);
  adjoint_on_cpu<float>(sharpness, activations, slope, adjoints, below, second);
}

void adjoint_layer_back(double sharpness, const Tensor& activations, const Tensor& slope,
                        const Tensor& adjoints, const Tensor& second, Tensor& cotangents, Tensor& below,
                        Tensor& partial) {
  if (on_device_path(activations))
    return adjoint_back_composed(sharpness, activations, slope, adjoints, second, cotangents, below, partial);
  if (activations.is_double())
    return adjoint_back_on_cpu<double>(sharpness, activations, slope, adjoints, second, cotangents, below,
                                       partial);
  adjoint_back_on_cpu<float>(sharpness, activations, slope, adjoints, second, cotangents, below, partial);
}

}  // namespace arapfields
