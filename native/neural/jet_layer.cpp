// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/jet_layer.h"

#include <ATen/ATen.h>

#include "core/aten_path.h"
#include "neural/jet_kernels.h"

namespace arapfields {
namespace {

template <class Scalar>
ActivationBlock<Scalar> block_of(const LayerStep& step, at::Tensor& activations, const at::Tensor& slope) {
  ActivationBlock<Scalar> block;
  block.activations = activations.data_ptr<Scalar>();
  block.slope = slope.defined() ? slope.data_ptr<Scalar>() : nullptr;
  block.sharpness = static_cast<Scalar>(step.sharpness);
  block.points = activations.size(0) / step.columns;
  block.width = activations.size(1);
  block.columns = step.columns;
  return block;
}

template <class Scalar>
void activate_on_cpu(const LayerStep& step, at::Tensor& activations, at::Tensor& slope, at::Tensor& jets,
                     const at::Tensor& bias) {
  ActivationBlock<Scalar> block = block_of<Scalar>(step, activations, slope);
  block.bias = bias.data_ptr<Scalar>();
  if (step.columns > 1) block.jets = jets.data_ptr<Scalar>();
  ARAPFIELDS_DISPATCH(activate(block));
}

template <class Scalar>
void activate_back_on_cpu(const LayerStep& step, at::Tensor& activations, const at::Tensor& slope,
                          const at::Tensor& partial, at::Tensor& cotangents, at::Tensor& bias_gradient) {
  const ActivationBlock<Scalar> block = block_of<Scalar>(step, activations, slope);
  const Scalar* more = partial.defined() ? partial.data_ptr<Scalar>() : nullptr;
  ARAPFIELDS_DISPATCH(
      activate_back(block, more, cotangents.data_ptr<Scalar>(), bias_gradient.data_ptr<Scalar>()));
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

at::Tensor by_column(const at::Tensor& activations, int columns) {
  return activations.view({columns, activations.size(0) / columns, activations.size(1)});
}

void activate_aten(const LayerStep& step, at::Tensor& activations, at::Tensor& slope, at::Tensor& jets,
                   const at::Tensor& bias) {
  at::Tensor z = by_column(activations, step.columns), z0 = z[0];
  const at::Tensor t = step.sharpness * (z0 + bias);
  const at::Tensor s = at::sigmoid(t);
  const at::Tensor value = (at::relu(t) + at::log1p(at::exp(-t.abs()))) / step.sharpness;
  if (step.columns > 1) {
    at::Tensor h = by_column(jets, step.columns);
    h[0].copy_(value);
    h.slice(0, 1).copy_(s * z.slice(0, 1));
  }
  z0.copy_(value);
  if (slope.defined()) slope.copy_(s);
}

void activate_back_aten(const LayerStep& step, at::Tensor& activations, const at::Tensor& s,
                        const at::Tensor& partial, at::Tensor& cotangents, at::Tensor& bias_gradient) {
  at::Tensor z = by_column(activations, step.columns), g = by_column(cotangents, step.columns);
  at::Tensor g0 = s * g[0];
  if (step.columns > 1) g0 += step.sharpness * s * (1 - s) * (z.slice(0, 1) * g.slice(0, 1)).sum(0);
  g.mul_(s);
  g[0].copy_(g0);
  if (partial.defined()) cotangents.add_(partial);
  z.slice(0, 1).mul_(s);
  bias_gradient.add_(g[0].sum(0));
}

void encode_aten(const at::Tensor& points, double frequency, int octaves, at::Tensor& encoding) {
  const Index n = points.size(0);
  const at::Tensor f = at::pow(2.0, at::arange(octaves, points.options().dtype(at::kDouble))) * frequency;
  const at::Tensor angle = points.to(at::kDouble).unsqueeze(-1) * f;  // (n, 3, octaves)
  const at::Tensor c = at::cos(angle), s = at::sin(angle);
  encoding[0].copy_(at::stack({c, s}, -1).view({n, 6 * octaves}));
  if (encoding.size(0) > 1) encoding[1].copy_(at::stack({-f * s, f * c}, -1).view({n, 6 * octaves}));
  if (encoding.size(0) > 2) encoding[2].copy_(at::stack({-f * f * c, -f * f * s}, -1).view({n, 6 * octaves}));
}

}  // namespace

void activate_layer(const LayerStep& step, at::Tensor& activations, at::Tensor& slope, at::Tensor& jets,
                    const at::Tensor& bias) {
  if (on_aten_path(activations)) return activate_aten(step, activations, slope, jets, bias);
  if (activations.scalar_type() == at::kDouble)
    return activate_on_cpu<double>(step, activations, slope, jets, bias);
  activate_on_cpu<float>(step, activations, slope, jets, bias);
}

void activate_layer_back(const LayerStep& step, at::Tensor& activations, const at::Tensor& slope,
                         const at::Tensor& partial, at::Tensor& cotangents, at::Tensor& bias_gradient) {
  if (on_aten_path(activations))
    return activate_back_aten(step, activations, slope, partial, cotangents, bias_gradient);
  if (activations.scalar_type() == at::kDouble)
    return activate_back_on_cpu<double>(step, activations, slope, partial, cotangents, bias_gradient);
  activate_back_on_cpu<float>(step, activations, slope, partial, cotangents, bias_gradient);
}

void encode_points(const at::Tensor& points, double frequency, int octaves, at::Tensor& encoding) {
  if (on_aten_path(points)) return encode_aten(points, frequency, octaves, encoding);
  if (points.scalar_type() == at::kDouble) return encode_on_cpu<double>(points, frequency, octaves, encoding);
  encode_on_cpu<float>(points, frequency, octaves, encoding);
}

}  // namespace arapfields
