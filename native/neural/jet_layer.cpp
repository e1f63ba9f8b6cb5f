// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/jet_layer.h"

#include <ATen/ATen.h>

#include "neural/jet_kernels.h"

namespace arapfields {
namespace {

constexpr int first_of_pair[6] = {0, 1, 2, 0, 0, 1};
constexpr int second_of_pair[6] = {0, 1, 2, 1, 2, 2};

template <class Scalar>
ActivationBlock<Scalar> block_of(const LayerStep& step, at::Tensor& planes, const at::Tensor& slope) {
  ActivationBlock<Scalar> block;
  block.planes = planes.data_ptr<Scalar>();
  block.slope = slope.defined() ? slope.data_ptr<Scalar>() : nullptr;
  block.sharpness = static_cast<Scalar>(step.sharpness);
  block.points = planes.size(0) / step.columns;
  block.width = planes.size(1);
  block.columns = step.columns;
  block.mixed = step.mixed;
  return block;
}

template <class Scalar>
void activate_on_cpu(const LayerStep& step, at::Tensor& planes, at::Tensor& slope, at::Tensor& jets,
                     const at::Tensor& bias) {
  ActivationBlock<Scalar> block = block_of<Scalar>(step, planes, slope);
  block.bias = bias.data_ptr<Scalar>();
  if (step.columns > 1) block.jets = jets.data_ptr<Scalar>();
  ARAPFIELDS_DISPATCH(activate(block));
}

template <class Scalar>
void activate_back_on_cpu(const LayerStep& step, at::Tensor& planes, const at::Tensor& slope,
                          at::Tensor& cotangents, at::Tensor& bias_gradient) {
  const ActivationBlock<Scalar> block = block_of<Scalar>(step, planes, slope);
  ARAPFIELDS_DISPATCH(activate_back(block, cotangents.data_ptr<Scalar>(), bias_gradient.data_ptr<Scalar>()));
}

template <class Scalar>
void encode_on_cpu(const at::Tensor& points, double frequency, int octaves, at::Tensor& encoding) {
  EncodingBlock<Scalar> block;
  block.points = points.data_ptr<Scalar>();
  block.value = encoding.data_ptr<Scalar>();
  const Index size = encoding.stride(0);
  if (encoding.size(0) > 1) block.first = block.value + size;
  if (encoding.size(0) > 2) block.second = block.value + 2 * size;
  block.frequency = frequency;
  block.count = points.size(0);
  block.octaves = octaves;
  ARAPFIELDS_DISPATCH(encode(block));
}

at::Tensor by_column(const at::Tensor& planes, int columns) {
  return planes.view({columns, planes.size(0) / columns, planes.size(1)});
}

/// h of the derivative columns from those of z, as in activate_jets().
void compose_derivatives(const LayerStep& step, const at::Tensor& z, const at::Tensor& s, at::Tensor h) {
  for (int i = 0; i < 3; ++i) h[1 + i].copy_(s * z[1 + i]);
  if (step.columns < 10) return;
  const at::Tensor curve = step.sharpness * s * (1 - s);
  for (int p = 0; p < 6; ++p) {
    const at::Tensor bent = curve * z[1 + first_of_pair[p]] * z[1 + second_of_pair[p]];
    h[4 + p].copy_(p >= 3 && !step.mixed ? bent : bent + s * z[4 + p]);
  }
}

void activate_anywhere(const LayerStep& step, at::Tensor& planes, at::Tensor& slope, at::Tensor& jets,
                       const at::Tensor& bias) {
  at::Tensor z = by_column(planes, step.columns), z0 = z[0];
  const at::Tensor t = step.sharpness * (z0 + bias);
  const at::Tensor s = at::sigmoid(t);
  const at::Tensor value = (at::relu(t) + at::log1p(at::exp(-t.abs()))) / step.sharpness;
  if (step.columns > 1) {
    at::Tensor h = by_column(jets, step.columns);
    h[0].copy_(value);
    compose_derivatives(step, z, s, h);
  }
  z0.copy_(value);
  if (slope.defined()) slope.copy_(s);
}

void activate_back_anywhere(const LayerStep& step, at::Tensor& planes, const at::Tensor& s,
                            at::Tensor& cotangents, at::Tensor& bias_gradient) {
  const int columns = step.columns;
  at::Tensor z = by_column(planes, columns), g = by_column(cotangents, columns);
  at::Tensor g0 = s * g[0];
  if (columns > 1) {
    const at::Tensor curve = step.sharpness * s * (1 - s), third = step.sharpness * curve * (1 - 2 * s);
    at::Tensor sum = (z.slice(0, 1, 4) * g.slice(0, 1, 4)).sum(0);
    std::vector<at::Tensor> first;
    for (int i = 0; i < 3; ++i) first.push_back(s * g[1 + i]);
    at::Tensor bent = at::zeros_like(g0);
    for (int p = 0; p < (columns == 10 ? 6 : 0); ++p) {
      const int i = first_of_pair[p], j = second_of_pair[p];
      if (p < 3 || step.mixed) sum += z[4 + p] * g[4 + p];
      bent += z[1 + i] * z[1 + j] * g[4 + p];
      first[static_cast<std::size_t>(i)] += curve * z[1 + j] * g[4 + p];
      first[static_cast<std::size_t>(j)] += curve * z[1 + i] * g[4 + p];
    }
    g0 += curve * sum + third * bent;
    for (int i = 0; i < 3; ++i) g[1 + i].copy_(first[static_cast<std::size_t>(i)]);
    if (columns == 10) g.slice(0, 4, 10).mul_(s);
    const at::Tensor old = z.clone();
    compose_derivatives(step, old, s, z);
  }
  g[0].copy_(g0);
  bias_gradient.add_(g0.sum(0));
}

void encode_anywhere(const at::Tensor& points, double frequency, int octaves, at::Tensor& encoding) {
  const Index n = points.size(0);
  const at::Tensor f = at::pow(2.0, at::arange(octaves, points.options().dtype(at::kDouble))) * frequency;
  const at::Tensor angle = points.to(at::kDouble).unsqueeze(-1) * f;  // (n, 3, octaves)
  const at::Tensor c = at::cos(angle), s = at::sin(angle);
  encoding[0].copy_(at::stack({c, s}, -1).view({n, 6 * octaves}));
  if (encoding.size(0) > 1) encoding[1].copy_(at::stack({-f * s, f * c}, -1).view({n, 6 * octaves}));
  if (encoding.size(0) > 2) encoding[2].copy_(at::stack({-f * f * c, -f * f * s}, -1).view({n, 6 * octaves}));
}

}  // namespace

void activate_layer(const LayerStep& step, at::Tensor& planes, at::Tensor& slope, at::Tensor& jets,
                    const at::Tensor& bias) {
  if (!planes.is_cpu()) return activate_anywhere(step, planes, slope, jets, bias);
  if (planes.scalar_type() == at::kDouble) return activate_on_cpu<double>(step, planes, slope, jets, bias);
  activate_on_cpu<float>(step, planes, slope, jets, bias);
}

void activate_layer_back(const LayerStep& step, at::Tensor& planes, const at::Tensor& slope,
                         at::Tensor& cotangents, at::Tensor& bias_gradient) {
  if (!planes.is_cpu()) return activate_back_anywhere(step, planes, slope, cotangents, bias_gradient);
  if (planes.scalar_type() == at::kDouble)
    return activate_back_on_cpu<double>(step, planes, slope, cotangents, bias_gradient);
  activate_back_on_cpu<float>(step, planes, slope, cotangents, bias_gradient);
}

void encode_points(const at::Tensor& points, double frequency, int octaves, at::Tensor& encoding) {
  if (!points.is_cpu()) return encode_anywhere(points, frequency, octaves, encoding);
  if (points.scalar_type() == at::kDouble) return encode_on_cpu<double>(points, frequency, octaves, encoding);
  encode_on_cpu<float>(points, frequency, octaves, encoding);
}

}  // namespace arapfields
