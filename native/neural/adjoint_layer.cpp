// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/adjoint_kernels.h"
#include "neural/jet_layer.h"
#include "tensors/device_path.h"
#include "tensors/operations.h"

namespace arapfields {
namespace {

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

/// Products of the derivatives z (3, n, width) by pairs of axes, (6, n, width): xx, yy, zz, xy, xz, yz.
Tensor by_pairs(const Tensor& z) {
  const Tensor pairs = empty({6, z.size(1), z.size(2)}, z);
  multiply_elements(pairs.slice(0, 0, 3), z, z);
  multiply_elements(pairs.slice(0, 3, 5), z.slice(0, 0, 1), z.slice(0, 1, 3));
  multiply_elements(pairs.slice(0, 5, 6), z.slice(0, 1, 2), z.slice(0, 2, 3));
  return pairs;
}

void adjoint_composed(double sharpness, const Tensor& activations, const Tensor& s, const Tensor& adjoints,
                      Tensor& below, Tensor& second) {
  const Index outputs = second.size(2), n = s.size(0), width = s.size(1);
  const Tensor z = activations.view({4, n, width}).from(0, 1);
  const Tensor q = by_output(adjoints, outputs).expand({outputs, n, width}), curve = sharpness * s * (1 - s);
  by_output(below, outputs).assign(s * q);
  second += batch_product((curve * by_pairs(z)).transpose(0, 1), q.permute({1, 2, 0}));
}

void adjoint_back_composed(double sharpness, const Tensor& activations, const Tensor& s,
                           const Tensor& adjoints, const Tensor& second, Tensor& cotangents, Tensor& below,
                           Tensor& partial) {
  const Index outputs = second.size(2), n = s.size(0), width = s.size(1);
  const Tensor z = activations.view({4, n, width}).from(0, 1);
  const Tensor q = by_output(adjoints, outputs).expand({outputs, n, width}), curve = sharpness * s * (1 - s);
  Tensor g = by_output(cotangents, outputs), part = partial.view({4, n, width});
  const Tensor bent = batch_product(second.transpose(1, 2), by_pairs(z).transpose(0, 1)).transpose(0, 1);
  // Of each pair Σ q d over the outputs; a pair of one axis acts on its derivative twice.
  const Tensor weighted = batch_product(second, q.transpose(0, 1)).transpose(0, 1) * curve;
  weighted.slice(0, 0, 3) *= 2.0;
  const Tensor x = weighted[0], y = weighted[1], w = weighted[2];
  const Tensor xy = weighted[3], xw = weighted[4], yw = weighted[5];
  const Tensor matrix = stack({x, xy, xw, xy, y, yw, xw, yw, w}, 0).view({3, 3, n, width});
  part.from(0, 1).assign(sum(matrix * z, {1}));
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
