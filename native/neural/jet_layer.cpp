// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/jet_layer.h"

#include "neural/jet_kernels.h"
#include "tensors/device_path.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

template <class Scalar>
ActivationBlock<Scalar> block_of(const LayerStep& step, Tensor& activations, const Tensor& slope) {
  ActivationBlock<Scalar> block;
  block.activations = activations.data<Scalar>();
  block.slope = slope.defined() ? slope.data<Scalar>() : nullptr;
  block.sharpness = static_cast<Scalar>(step.sharpness);
  block.points = activations.size(0) / step.columns;
  block.width = activations.size(1);
  block.columns = step.columns;
  return block;
}

template <class Scalar>
void activate_on_cpu(const LayerStep& step, Tensor& activations, Tensor& slope, Tensor& jets,
                     const Tensor& bias) {
  ActivationBlock<Scalar> block = block_of<Scalar>(step, activations, slope);
  block.bias = bias.data<Scalar>();
  if (step.columns > 1) block.jets = jets.data<Scalar>();
  ARAPFIELDS_DISPATCH(activate(block));
}

template <class Scalar>
void activate_back_on_cpu(const LayerStep& step, Tensor& activations, const Tensor& slope,
                          const Tensor& partial, Tensor& cotangents, Tensor& bias_gradient) {
  const ActivationBlock<Scalar> block = block_of<Scalar>(step, activations, slope);
  const Scalar* more = partial.defined() ? partial.data<Scalar>() : nullptr;
  ARAPFIELDS_DISPATCH(activate_back(block, more, cotangents.data<Scalar>(), bias_gradient.data<Scalar>()));
}

template <class Scalar>
void encode_on_cpu(const Tensor& points, double frequency, int octaves, Tensor& encoding) {
  EncodingBlock<Scalar> block;
  block.points = points.data<Scalar>();
  block.value = encoding.data<Scalar>();
  const Index size = encoding.stride(0);
  if (encoding.size(0) > 1) block.first = block.value + size;
  if (encoding.size(0) > 2) block.second = block.value + 2 * size;
  block.frequency = frequency;
  block.count = points.size(0);
  block.octaves = octaves;
  ARAPFIELDS_DISPATCH(encode(block));
}

Tensor by_column(const Tensor& activations, int columns) {
  return activations.view({columns, activations.size(0) / columns, activations.size(1)});
}

void activate_composed(const LayerStep& step, Tensor& activations, Tensor& slope, Tensor& jets,
                       const Tensor& bias) {
  Tensor z = by_column(activations, step.columns), z0 = z[0];
  const Tensor t = step.sharpness * (z0 + bias);
  const Tensor s = sigmoid(t);
  const Tensor value = (clamp_min(t, 0.0) + log1p(exp(-abs(t)))) / step.sharpness;
  if (step.columns > 1) {
    Tensor h = by_column(jets, step.columns);
    h[0].assign(value);
    h.from(0, 1).assign(s * z.from(0, 1));
  }
  z0.assign(value);
  if (slope.defined()) slope.assign(s);
}

void activate_back_composed(const LayerStep& step, Tensor& activations, const Tensor& s,
                            const Tensor& partial, Tensor& cotangents, Tensor& bias_gradient) {
  Tensor z = by_column(activations, step.columns), g = by_column(cotangents, step.columns);
  Tensor g0 = s * g[0];
  if (step.columns > 1) g0 += step.sharpness * s * (1 - s) * sum(z.from(0, 1) * g.from(0, 1), {0});
  g *= s;
  g[0].assign(g0);
  if (partial.defined()) cotangents += partial;
  z.from(0, 1) *= s;
  bias_gradient += sum(g[0], {0});
}

void encode_composed(const Tensor& points, double frequency, int octaves, Tensor& encoding) {
  const Index n = points.size(0);
  Vector frequencies(octaves);
  for (int k = 0; k < octaves; ++k) frequencies[k] = std::ldexp(frequency, k);
  const Tensor f = upload(tensor_view(frequencies), points);
  const Tensor angle = points.to(NumberType::float64).unsqueeze(-1) * f;  // (n, 3, octaves)
  const Tensor c = cos(angle), s = sin(angle);
  encoding[0].assign(stack({c, s}, -1).view({n, 6 * octaves}));
  if (encoding.size(0) > 1) encoding[1].assign(stack({-f * s, f * c}, -1).view({n, 6 * octaves}));
  if (encoding.size(0) > 2) encoding[2].assign(stack({-f * f * c, -f * f * s}, -1).view({n, 6 * octaves}));
}

}  // namespace

void activate_layer(const LayerStep& step, Tensor& activations, Tensor& slope, Tensor& jets,
                    const Tensor& bias) {
  if (on_device_path(activations)) return activate_composed(step, activations, slope, jets, bias);
  if (activations.is_double()) return activate_on_cpu<double>(step, activations, slope, jets, bias);
  activate_on_cpu<float>(step, activations, slope, jets, bias);
}

void activate_layer_back(const LayerStep& step, Tensor& activations, const Tensor& slope,
                         const Tensor& partial, Tensor& cotangents, Tensor& bias_gradient) {
  if (on_device_path(activations))
    return activate_back_composed(step, activations, slope, partial, cotangents, bias_gradient);
  if (activations.is_double())
    return activate_back_on_cpu<double>(step, activations, slope, partial, cotangents, bias_gradient);
  activate_back_on_cpu<float>(step, activations, slope, partial, cotangents, bias_gradient);
}

void encode_points(const Tensor& points, double frequency, int octaves, Tensor& encoding) {
  if (on_device_path(points)) return encode_composed(points, frequency, octaves, encoding);
  if (points.is_double()) return encode_on_cpu<double>(points, frequency, octaves, encoding);
  encode_on_cpu<float>(points, frequency, octaves, encoding);
}

}  // namespace arapfields
