// SPDX-License-Identifier: GPL-3.0-or-later
#include <ATen/ATen.h>

#include "core/aten_path.h"
#include "neural/adjoint_kernels.h"
#include "neural/jet_layer.h"

namespace arapfields {
namespace {

constexpr int first_of_pair[6] = {0, 1, 2, 0, 0, 1};
constexpr int second_of_pair[6] = {0, 1, 2, 1, 2, 2};

template <class Scalar>
AdjointBlock<Scalar> block_of(double sharpness, const at::Tensor& activations, const at::Tensor& slope,
                              const at::Tensor& adjoints, at::Tensor& below) {
  AdjointBlock<Scalar> block;
  block.activations = activations.data_ptr<Scalar>();
  block.slope = slope.data_ptr<Scalar>();
  block.adjoints = adjoints.data_ptr<Scalar>();
  block.shared = adjoints.size(0) != below.size(0);
  block.below = below.data_ptr<Scalar>();
  block.sharpness = static_cast<Scalar>(sharpness);
  block.points = slope.size(0);
  block.width = slope.size(1);
  block.outputs = static_cast<int>(below.size(0) / slope.size(0));
  return block;
}

template <class Scalar>
void adjoint_on_cpu(double sharpness, const at::Tensor& activations, const at::Tensor& slope,
                    const at::Tensor& adjoints, at::Tensor& below, at::Tensor& second) {
  const AdjointBlock<Scalar> block = block_of<Scalar>(sharpness, activations, slope, adjoints, below);
  ARAPFIELDS_DISPATCH(adjoint(block, second.data_ptr<Scalar>()));
}

template <class Scalar>
void adjoint_back_on_cpu(double sharpness, const at::Tensor& activations, const at::Tensor& slope,
                         const at::Tensor& adjoints, const at::Tensor& second, at::Tensor& cotangents,
                         at::Tensor& below, at::Tensor& partial) {
  const AdjointBlock<Scalar> block = block_of<Scalar>(sharpness, activations, slope, adjoints, below);
  ARAPFIELDS_DISPATCH(adjoint_back(block, second.data_ptr<Scalar>(), cotangents.data_ptr<Scalar>(),
                                   partial.data_ptr<Scalar>()));
}

/// (rows/points, points, width), one row a time for all points where there is but one.
at::Tensor by_output(const at::Tensor& rows, Index outputs) {
  return rows.view({outputs, rows.size(0) / outputs, rows.size(1)});
}

void adjoint_aten(double sharpness, const at::Tensor& activations, const at::Tensor& s,
                  const at::Tensor& adjoints, at::Tensor& below, at::Tensor& second) {
  const Index outputs = second.size(2);
  const at::Tensor z = activations.view({4, s.size(0), s.size(1)}).slice(0, 1);
  const at::Tensor q = by_output(adjoints, outputs), curve = sharpness * s * (1 - s);
  by_output(below, outputs).copy_(s * q);
  for (int c = 0; c < 6; ++c) {
    const at::Tensor bent = curve * z[first_of_pair[c]] * z[second_of_pair[c]];
    second.select(1, c).add_((q * bent).sum(2).t());
  }
}

void adjoint_back_aten(double sharpness, const at::Tensor& activations, const at::Tensor& s,
                       const at::Tensor& adjoints, const at::Tensor& second, at::Tensor& cotangents,
                       at::Tensor& below, at::Tensor& partial) {
  const Index outputs = second.size(2);
  const at::Tensor z = activations.view({4, s.size(0), s.size(1)}).slice(0, 1);
  const at::Tensor q = by_output(adjoints, outputs), curve = sharpness * s * (1 - s);
  at::Tensor g = by_output(cotangents, outputs), part = partial.view({4, s.size(0), s.size(1)});
  at::Tensor bent = at::zeros_like(g);
  part.zero_();
  for (int c = 0; c < 6; ++c) {
    const int i = first_of_pair[c], j = second_of_pair[c];
    const at::Tensor d = second.select(1, c).t().unsqueeze(-1);  // (outputs, n, 1)
    const at::Tensor weighted = (q * d).sum(0) * curve;
    bent += d * (z[i] * z[j]);
    part[1 + i].add_(weighted * z[j]);
    part[1 + j].add_(weighted * z[i]);
  }
  part[0].copy_(curve * (q * (g + sharpness * (1 - 2 * s) * bent)).sum(0));
  g.copy_(s * g + curve * bent);
  by_output(below, outputs).copy_(s * q);
}

}  // namespace

void adjoint_layer(double sharpness, const at::Tensor& activations, const at::Tensor& slope,
                   const at::Tensor& adjoints, at::Tensor& below, at::Tensor& second) {
  if (on_aten_path(activations)) return adjoint_aten(sharpness, activations, slope, adjoints, below, second);
  if (activations.scalar_type() == at::kDouble)
    return adjoint_on_cpu<double>(sharpness, activations, slope, adjoints, below, second);
  adjoint_on_cpu<float>(sharpness, activations, slope, adjoints, below, second);
}

void adjoint_layer_back(double sharpness, const at::Tensor& activations, const at::Tensor& slope,
                        const at::Tensor& adjoints, const at::Tensor& second, at::Tensor& cotangents,
                        at::Tensor& below, at::Tensor& partial) {
  if (on_aten_path(activations))
    return adjoint_back_aten(sharpness, activations, slope, adjoints, second, cotangents, below, partial);
  if (activations.scalar_type() == at::kDouble)
    return adjoint_back_on_cpu<double>(sharpness, activations, slope, adjoints, second, cotangents, below,
                                       partial);
  adjoint_back_on_cpu<float>(sharpness, activations, slope, adjoints, second, cotangents, below, partial);
}

}  // namespace arapfields
