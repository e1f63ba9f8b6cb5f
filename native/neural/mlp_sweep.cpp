// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/mlp_sweep.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"
#include "neural/kernels.h"
#include "tensors/device.h"
#include "tensors/operations.h"
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

namespace {

/// The first rows·cols numbers of a flat buffer as a matrix.
Tensor matrix(const Tensor& flat, Index rows, Index cols) {
  return flat.narrow(0, 0, rows * cols).view({rows, cols});
}

/// The rounded copy of layer l's weight; undefined where its products are exact.
Tensor rounded_weight(const LayerViews& layers, int l) {
  return std::cmp_less(l, layers.rounded.size()) ? layers.rounded[l] : Tensor();
}

/// c = a Wᵀ or a W for layer l's weight W.
void times_weight(Tensor c, const Tensor& a, const LayerViews& layers, int l, bool transposed) {
  const Tensor rounded = rounded_weight(layers, l);
  const Tensor& weight = rounded.defined() ? rounded : layers.weights[l];
  const Tensor b = transposed ? weight.t() : weight;
  if (rounded.defined())
    c.assign(product(a.to(NumberType::bfloat16), b));
  else
    multiply(c, a, b);
}

/// gradient += aᵀ b, the part of layer l's weight.
void add_outer(Tensor gradient, const Tensor& a, const Tensor& b, const LayerViews& layers, int l) {
  if (rounded_weight(layers, l).defined())
    gradient += product(a.to(NumberType::bfloat16).t(), b.to(NumberType::bfloat16));
  else
    add_multiplied(gradient, a.t(), b);
}

int derivatives_of(const Block& block) { return block.columns == 4 ? 2 : 1; }

/// Pre-activations of the first layer: each coordinate's derivatives meet their own part of the weight alone.
void encode_layer(const MlpShape& shape, const Tensor& weight, const Tensor& points, Block& block) {
  encode_points(points.narrow(0, block.begin, block.count), shape.frequency, shape.octaves, block.encoding);
  const Index m = block.count, part = 2 * shape.octaves;
  Tensor& z = block.activations[0];
  multiply(z.narrow(0, 0, m), block.encoding[0], weight.t());
  for (int derivative = 1; derivative < derivatives_of(block); ++derivative)
    for (int i = 0; i < 3; ++i)
      multiply(z.narrow(0, (3 * derivative - 2 + i) * m, m),
               block.encoding[derivative].narrow(1, i * part, part), weight.narrow(1, i * part, part).t());
}

void encode_layer_back(const MlpShape& shape, const Tensor& cotangents, Block& block, Tensor gradient) {
  const Index m = block.count, part = 2 * shape.octaves;
  add_multiplied(gradient, cotangents.narrow(0, 0, m).t(), block.encoding[0]);
  for (int derivative = 1; derivative < derivatives_of(block); ++derivative)
    for (int i = 0; i < 3; ++i)
      add_multiplied(gradient.narrow(1, i * part, part),
                     cotangents.narrow(0, (3 * derivative - 2 + i) * m, m).t(),
                     block.encoding[derivative].narrow(1, i * part, part));
}

/// The derivatives of the outputs by the activations of layer l: rows for each point, at the top for all.
const Tensor& adjoints_of(const LayerViews& layers, const Block& block, int l) {
  return std::cmp_less(l, block.adjoints.size()) ? block.adjoints[l] : layers.weights.back();
}

/// The encoding's entries as (count, 3, 2·octaves): an entry depends on one coordinate alone, so its second
/// derivatives are one number each.
Tensor by_coordinate(const Tensor& entries, const MlpShape& shape) {
  return entries.view({-1, 3, 2 * shape.octaves});
}

/// Downwards after the forward sweep: the outputs' derivatives by every layer, and with them the second
/// derivatives into result[4:10, begin:begin+count].
void sweep_adjoints(const MlpShape& shape, const LayerViews& layers, Block& block, Workspace& space,
                    Tensor& result) {
  const Index m = block.count, rows = shape.outputs * m;
  Tensor below = matrix(space.jets, rows, shape.width);
  Tensor second = space.second.narrow(0, 0, m * 6 * shape.outputs).view({m, 6, shape.outputs});
  second.set_zero();
  for (int l = shape.layers - 1; l >= 0; --l) {
    adjoint_layer(shape.softplus_sharpness, block.activations[l], block.slope[l],
                  adjoints_of(layers, block, l), below, second);
    if (l > 0) times_weight(block.adjoints[l - 1], below, layers, l, false);
  }
  Tensor encoded = matrix(space.below, rows, shape.encoded());
  multiply(encoded, below, layers.weights[0]);
  const Tensor entries = encoded.view({shape.outputs, m, 3, 2 * shape.octaves});
  const Tensor bent = sum(entries *= by_coordinate(block.encoding[2], shape), {3});
  second.narrow(1, 0, 3) += bent.permute({1, 2, 0});
  result.narrow(0, 4, 6).narrow(1, block.begin, m).assign(second.transpose(0, 1));
}

/// The way back of sweep_adjoints(), upwards: adds to `gradient`, and leaves in space.partial what the
/// activations of each layer receive.
void sweep_adjoints_back(const MlpShape& shape, const LayerViews& layers, const Tensor& cotangents,
                         Block& block, Workspace& space, LayerViews& gradient) {
  const Index m = block.count, rows = shape.outputs * m;
  Tensor second = space.second.narrow(0, 0, m * 6 * shape.outputs).view({m, 6, shape.outputs});
  second.assign(cotangents.narrow(0, 4, 6).narrow(1, block.begin, m).transpose(0, 1));
  Tensor here = matrix(space.jets, rows, shape.width), spare = matrix(space.other, rows, shape.width);
  Tensor encoded = empty({shape.outputs, m, 3, 2 * shape.octaves}, second);
  multiply_elements(encoded, second.narrow(1, 0, 3).permute({2, 0, 1}).unsqueeze(3),
                    by_coordinate(block.encoding[2], shape));
  Tensor lower = encoded.view({rows, shape.encoded()});
  for (int l = 0; l < shape.layers; ++l) {
    times_weight(here, lower, layers, l, true);
    Tensor below = matrix(space.below, rows, shape.width);
    Tensor partial = matrix(space.partial[l], block.columns * m, shape.width);
    adjoint_layer_back(shape.softplus_sharpness, block.activations[l], block.slope[l],
                       adjoints_of(layers, block, l), second, here, below, partial);
    add_outer(gradient.weights[l], below, lower, layers, l);
    lower = here;
    std::swap(here, spare);
  }
  gradient.weights.back() += sum(lower.view({shape.outputs, m, shape.width}), {1});
}

}  // namespace

LayerViews::LayerViews(const MlpShape& shape, const Tensor& flat) {
  Index begin = 0;
  for (int l = 0; l <= shape.layers; ++l) {
    const Index out = shape.fan_out(l), in = shape.fan_in(l);
    weights.push_back(flat.narrow(0, begin, out * in).view({out, in}));
    biases.push_back(flat.narrow(0, begin + out * in, out));
    begin += out * (in + 1);
  }
}

int sweep_threads(const Tensor& like, std::size_t blocks) {
  return on_device_path(like)
             ? 1
             : static_cast<int>(std::min<std::size_t>(blocks, static_cast<std::size_t>(thread_count())));
}

std::vector<Block> split_points(Index n, JetOrder order, bool in_cache) {
  constexpr Index fewest_points = 32, multiple = 8;
  // Blocks whose activations fit a core's second-level cache; elsewhere one block that memory bounds.
  const Index best = !in_cache ? (Index(1) << 19) / columns(order) : order == JetOrder::value ? 512 : 128;
  Index count = (n + best - 1) / best;
  if (in_cache) count = std::min((count + multiple - 1) / multiple * multiple, n / fewest_points);
  count = std::max<Index>(count, 1);
  std::vector<Block> blocks(static_cast<std::size_t>(count));
  for (Index b = 0; b < count; ++b) {
    Block& block = blocks[static_cast<std::size_t>(b)];
    block.begin = b * n / count;
    block.count = (b + 1) * n / count - block.begin;
    block.columns = std::min(columns(order), 4);
    block.second = order == JetOrder::second;
  }
  return blocks;
}

void allocate(const MlpShape& shape, const Tensor& like, bool keep, Block& block) {
  const Index m = block.count, stored = block.second ? 3 : 2;
  block.encoding = empty({stored, m, shape.encoded()}, like);
  block.activations.clear(), block.slope.clear(), block.adjoints.clear();
  // Where nothing is kept, two buffers take turns.
  for (int l = 0; l < shape.layers; ++l) {
    const bool own = keep || l < 2;
    block.activations.push_back(own ? empty({block.columns * m, shape.width}, like)
                                    : block.activations[l - 2]);
    block.slope.push_back(keep ? empty({m, shape.width}, like) : Tensor());
  }
  for (int l = 0; l + 1 < shape.layers && block.second; ++l)
    block.adjoints.push_back(empty({shape.outputs * m, shape.width}, like));
}

void borrow(const Block& memory, Block& block) {
  const Index m = block.count;
  block.encoding = memory.encoding.view({-1})
                       .narrow(0, 0, memory.encoding.size(0) * m * memory.encoding.size(2))
                       .view({memory.encoding.size(0), m, memory.encoding.size(2)});
  block.activations.clear(), block.slope.clear(), block.adjoints.clear();
  for (const Tensor& activations : memory.activations)
    block.activations.push_back(activations.narrow(0, 0, block.columns * m));
  for (const Tensor& slope : memory.slope)
    block.slope.push_back(slope.defined() ? slope.narrow(0, 0, m) : slope);
  for (const Tensor& adjoints : memory.adjoints)
    block.adjoints.push_back(adjoints.narrow(0, 0, adjoints.size(0) / memory.count * m));
}

Workspace make_workspace(const MlpShape& shape, const Tensor& like, const Block& largest) {
  Workspace space;
  const Index m = largest.count, plane = m * shape.width;
  const Index wide = largest.second ? std::max(largest.columns, shape.outputs) : largest.columns;
  space.jets = empty({wide * plane}, like);
  space.other = empty({wide * plane}, like);
  space.output = empty({largest.columns * m * shape.outputs}, like);
  if (!largest.second) return space;
  space.below = empty({shape.outputs * std::max(plane, m * shape.encoded())}, like);
  space.second = empty({m * 6 * shape.outputs}, like);
  for (int l = 0; l < shape.layers; ++l) space.partial.push_back(empty({largest.columns * plane}, like));
  return space;
}

Index Blocks::gradient_groups() const {
  constexpr Index fewest = 8, most = 64, blocks_a_group = 4;
  return std::min(count(), std::clamp(count() / blocks_a_group, fewest, most));
}

void Blocks::for_each(Index groups, const std::function<void(Block&, Workspace&, Index, bool)>& body) {
  const ThreadScope scope(std::min(thread_count(), static_cast<int>(workspaces.size())));
  parallel_jobs_in_slots(groups, [&](Index g, Index slot) {
    const Index begin = g * count() / groups, end = (g + 1) * count() / groups;
    for (Index b = begin; b < end; ++b)
      body(blocks[static_cast<std::size_t>(b)], workspaces[static_cast<std::size_t>(slot)], g, b == begin);
  });
}

void sweep_forward(const MlpShape& shape, const LayerViews& layers, const Tensor& points, Block& block,
                   Workspace& space, Tensor& result) {
  if (block.count == 0) return;
  const Index rows = block.columns * block.count;
  Tensor jets = matrix(space.jets, rows, shape.width);
  for (int l = 0; l < shape.layers; ++l) {
    Tensor& activations = block.activations[l];
    const Tensor& below = block.columns == 1 && l > 0 ? block.activations[l - 1] : jets;
    if (l == 0)
      encode_layer(shape, layers.weights[0], points, block);
    else
      times_weight(activations, below, layers, l, true);
    activate_layer({shape.softplus_sharpness, block.columns}, activations, block.slope[l], jets,
                   layers.biases[l]);
  }
  const Tensor& top = block.columns == 1 ? block.activations.back() : jets;
  Tensor output = matrix(space.output, rows, shape.outputs);
  multiply(output, top, layers.weights.back().t());
  output.narrow(0, 0, block.count).add(layers.biases.back());
  result.narrow(0, 0, block.columns)
      .narrow(1, block.begin, block.count)
      .assign(output.view({block.columns, block.count, shape.outputs}));
  if (block.second) sweep_adjoints(shape, layers, block, space, result);
}

void sweep_back(const MlpShape& shape, const LayerViews& layers, const Tensor& cotangents, Block& block,
                Workspace& space, LayerViews& gradient) {
  if (block.count == 0) return;
  const Index rows = block.columns * block.count;
  Tensor upper = matrix(space.output, rows, shape.outputs);
  upper.view({block.columns, block.count, shape.outputs})
      .assign(cotangents.narrow(0, 0, block.columns).narrow(1, block.begin, block.count));
  if (block.second) sweep_adjoints_back(shape, layers, cotangents, block, space, gradient);
  gradient.biases.back() += sum(upper.narrow(0, 0, block.count), {0});
  Tensor here = matrix(space.jets, rows, shape.width), spare = matrix(space.other, rows, shape.width);
  for (int l = shape.layers - 1; l >= 0; --l) {
    Tensor& activations = block.activations[l];
    times_weight(here, upper, layers, l + 1, false);
    const Tensor partial = block.second ? matrix(space.partial[l], rows, shape.width) : Tensor();
    activate_layer_back({shape.softplus_sharpness, block.columns}, activations, block.slope[l], partial, here,
                        gradient.biases[l]);
    add_outer(gradient.weights[l + 1], upper, activations, layers, l + 1);
    upper = here;
    std::swap(here, spare);
  }
  encode_layer_back(shape, upper, block, gradient.weights[0]);
}

void sweep_to_points(const MlpShape& shape, const LayerViews& layers, Block& block, Workspace& space,
                     Tensor& gradients) {
  if (block.count == 0) return;
  const Index m = block.count;
  Tensor here = matrix(space.jets, m, shape.width), spare = matrix(space.other, m, shape.width);
  multiply_elements(here, block.slope.back(), layers.weights.back());
  for (int l = shape.layers - 2; l >= 0; --l) {
    multiply(spare, here, layers.weights[l + 1]);
    spare *= block.slope[l];
    std::swap(here, spare);
  }
  const Tensor encoded = product(here, layers.weights[0]) *= block.encoding[1];
  gradients.narrow(0, block.begin, m).assign(sum(encoded.view({m, 3, 2 * shape.octaves}), {2}));
}

}  // namespace arapfields
